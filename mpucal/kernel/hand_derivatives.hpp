// Derivatives of x by the parameters with fixed gains, four parameters at a time, propagated with the recursion.
#pragma once
#include "fisher.hpp"
#include "hand_recursion.hpp"

namespace mpucal {
namespace {  // each instruction set has its own copy

// Shared coefficients of the derivatives of four steps
struct HandCoefficients {
  Lane white[3][3], residual[3];                // sqrt(w) L^-1, and its product with e
  Lane q[4];                                    // E s + L r in the body, and 1
  Lane delay[3], lever[4][3];                   // D [omega]x s, D L
  Lane direction[3], stretch;                   // of s after the update
  Lane eta_b[4][3], eta_K[4][3], eta_K2[4][3];  // of d(F x) = eta x (F x), in the first frame

  MPUCAL_APART void compute(const HandParameters& p, double gravity, const HandSteps& steps, const HandPredicted& met) {
    whiten(met);
    measurement(p, steps, met);
    const Lane inverse_length = 1.0 / root(dot(met.plus, met.plus));
    stretch = gravity * inverse_length;
    for (int a = 0; a < 3; ++a) direction[a] = inverse_length * met.plus[a];
    turning(p, steps);
  }

 private:
  MPUCAL_INLINE void whiten(const HandPredicted& met) {
    whitener(met.S, Adjugate<Lane>(met.S), white);
    const Lane root_w = root(met.w);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b <= a; ++b) white[a][b] = root_w * white[a][b];
    multiply_lower(white, met.e, residual);
  }

  MPUCAL_INLINE void measurement(const HandParameters& p, const HandSteps& steps, const HandPredicted& met) {
    Lane s[3], swept[3], sum[3], DL[3][3];
    multiply(steps.C, met.s, s);
    const Lane(&w)[3] = steps.omega;
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      swept[i] = nmadd(w[k], s[j], w[j] * s[k]);
      sum[i] = madd(p.tau, swept[i], s[i] + steps.L_r[i]);
    }
    turn_round(sum, 1.0, q);
    multiply(p.D, swept, delay);
    multiply(p.D, steps.L, DL);
    turn_round(DL, lever);
  }

  MPUCAL_INLINE void turning(const HandParameters& p, const HandSteps& steps) {
    Lane J[3][3], CJ[3][3], CJK[3][3];
    steps.turn.left_jacobian(J);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) {
        const auto& C = steps.C_next;
        CJ[a][b] = steps.dt * madd(C[2][a], J[2][b], madd(C[1][a], J[1][b], C[0][a] * J[0][b]));
      }
    multiply(CJ, p.K, CJK);
    turn_round(CJK, eta_b);
    turn_by_K(CJ, steps.rate, eta_K, eta_K2);
  }
};

template <int G>
class HandDerivatives {
 public:
  HandDerivatives(const HandParameters& p, double gravity) {
    for (int g = 0; g < G; ++g) {
      gradient_[g] = all(0.0);
      for (auto& axis : dx_[g])
        for (Lane& lane : axis) lane = all(0.0);
    }
    for (int a = 0; a < 3; ++a) {
      put(dx_[Lanes::tilt / 4][a][kS], Lanes::tilt % 4, gravity * p.du[0][a]);
      put(dx_[(Lanes::tilt + 1) / 4][a][kS], (Lanes::tilt + 1) % 4, gravity * p.du[1][a]);
    }
  }

  // The next `count` steps; three rows of the Fisher matrix each
  void run(const HandSteps* steps, const HandPredicted* met, const HandCoefficients* coefficients, int count,
           Lane (*rows)[G]) {
    for_each<G>([&](auto g) { run_group<g>(steps, met, coefficients, count, rows); });
  }

  void write(double* gradient) const {
    for (int i = 0; i < 4 * G; ++i) gradient[i] = at(gradient_[i / 4], i % 4);
  }

 private:
  using State = Lane[3][kState];  // [axis][place]

  template <int g>
  MPUCAL_APART void run_group(const HandSteps* steps, const HandPredicted* met, const HandCoefficients* coefficients,
                              int count, Lane (*rows)[G]) {
    Lane gradient = gradient_[g];
    State x;
    for (int a = 0; a < 3; ++a)
      for (int k = 0; k < kState; ++k) x[a][k] = dx_[g][a][k];
    for (int i = 0; i < count; ++i) {
      const HandSteps& four = steps[i / 4];
      const HandCoefficients& c = coefficients[i / 4];
      const int t = i % 4;
      Lane e[3];
      innovate<g>(four, c, t, x, e);
      for (int a = 0; a < 3; ++a) {
        Lane row = at(c.white[a][0], t) * e[0];
        for (int b = 1; b <= a; ++b) row = madd(at(c.white[a][b], t), e[b], row);
        rows[3 * i + a][g] = row;
        gradient = madd(at(c.residual[a], t), row, gradient);
      }
      follow<g>(four, met[i / 4], c, t, e, x);
    }
    for (int a = 0; a < 3; ++a)
      for (int k = 0; k < kState; ++k) dx_[g][a][k] = x[a][k];
    gradient_[g] = gradient;
  }

  template <int g>
  MPUCAL_INLINE static void innovate(const HandSteps& four, const HandCoefficients& c, int t, const State& x,
                                     Lane (&e)[3]) {
    for (int j = 0; j < 3; ++j) {
      e[j] = all(0.0);
      if constexpr (g < 3)
        if (j == g) e[j] = e[j] - c.q[t];
      if constexpr (g == Lanes::tau / 4) e[j] = nmadd(at(c.delay[j], t), kTau, e[j]);
      if constexpr (g == Lanes::r / 4) e[j] = e[j] - c.lever[t][j];
      for (int b = 0; b < 3; ++b)
        e[j] = nmadd(at(four.C[j][b], t), x[b][kA], nmadd(at(four.Hs[j][b], t), x[b][kS], e[j]));
    }
  }

  // x + K e, and s keeps its length; then Phi x + eta x (Phi x). A reset forgets the chain.
  template <int g>
  MPUCAL_INLINE static void follow(const HandSteps& four, const HandPredicted& met, const HandCoefficients& c, int t,
                                   const Lane (&e)[3], State& x) {
    const auto& K = met.K[t];
    Lane along;
    for (int a = 0; a < 3; ++a) {
      for (int j = 0; j < 3; ++j) x[a][kS] = madd(at(K[a][j], kS), e[j], x[a][kS]);
      along = a ? madd(at(c.direction[a], t), x[a][kS], along) : at(c.direction[a], t) * x[a][kS];
    }
    const auto& Phi = four.chain.Phi;
    for (int a = 0; a < 3; ++a) {
      x[a][kS] = at(c.stretch, t) * nmadd(at(c.direction[a], t), along, x[a][kS]);
      for (int k = 1; k < kState; ++k)
        for (int j = 0; j < 3; ++j) x[a][k] = madd(at(K[a][j], k), e[j], x[a][k]);
      x[a][1] = madd(at(Phi[2], t), x[a][3], madd(at(Phi[1], t), x[a][2], at(Phi[0], t) * x[a][1]));
      x[a][2] = madd(at(Phi[1], t), x[a][3], at(Phi[0], t) * x[a][2]);
      x[a][3] = at(Phi[0], t) * x[a][3];
    }
    if (at(four.reset, t) >= 0.0)
      for (auto& axis : x) axis[1] = axis[2] = axis[3] = all(0.0);
    if constexpr (g == Lanes::b_omega / 4) add_turn(c.eta_b[t], met.x_next[t], x);
    if constexpr (g == Lanes::K / 4) add_turn(c.eta_K[t], met.x_next[t], x);
    if constexpr (g == Lanes::K / 4 + 1) add_turn(c.eta_K2[t], met.x_next[t], x);
    if constexpr (g >= kHandGroups) {  // a column of S times its force acts like b_omega
      Lane eta_S[3];
      for (int a = 0; a < 3; ++a) eta_S[a] = at(four.force[g - kHandGroups], t) * c.eta_b[t][a];
      add_turn(eta_S, met.x_next[t], x);
    }
  }

  // x += n x next
  MPUCAL_INLINE static void add_turn(const Lane (&n)[3], const Lane (&next)[3], State& x) {
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      for (int k = 0; k < kState; ++k) x[a][k] = nmadd(at(next[b], k), n[c], madd(at(next[c], k), n[b], x[a][k]));
    }
  }

  static constexpr int kTauLane = Lanes::tau % 4;
  inline static const Lane kTau{kTauLane == 0, kTauLane == 1, kTauLane == 2, kTauLane == 3};
  Lane dx_[G][3][kState], gradient_[G];
};
template <>
class HandDerivatives<0> {
 public:
  HandDerivatives(const HandParameters&, double) {}
};

}  // namespace
}  // namespace mpucal
