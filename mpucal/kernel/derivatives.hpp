// ds and dP by the parameters, four parameters at a time, carried through the steps beside the recursion.
#pragma once
#include "coefficients.hpp"
#include "fisher.hpp"

namespace mpucal {
namespace {  // each build of the filter keeps its own

// x += n x (a, b, c)
MPUCAL_INLINE void add_cross(const Lane (&n)[3], double a, double b, double c, Lane (&x)[3]) {
  x[0] = nmadd(b, n[2], madd(c, n[1], x[0]));
  x[1] = nmadd(c, n[0], madd(a, n[2], x[1]));
  x[2] = nmadd(a, n[1], madd(b, n[0], x[2]));
}

constexpr int kRowsOfFour = 6 + 4 * 3;  // of the Fisher matrix, for four steps

template <int G>
class Derivatives {
 public:
  Derivatives(const Parameters& p, const Constants& c) {
    for (int g = 0; g < G; ++g) {
      for (Lane& lane : ds_[g]) lane = all(0.0);
      for (Lane& lane : dP_[g]) lane = all(0.0);
      gradient_[g] = all(0.0);
    }
    for (int a = 0; a < 3; ++a) {
      put(ds_[Lanes::tilt0 / 4][a], Lanes::tilt0 % 4, c.gravity * p.du[0][a]);
      put(ds_[Lanes::tilt1 / 4][a], Lanes::tilt1 % 4, c.gravity * p.du[1][a]);
    }
  }

  // The next `count` steps; rows of the Fisher matrix, kRowsOfFour for four steps
  void run(const Coefficients* steps, int count, Lane (*rows)[G]) {
    for_each<G>([&](auto g) { run_group<g>(steps, count, rows); });
  }

  void write(double* gradient) const {
    for (int i = 0; i < 4 * G; ++i) gradient[i] = at(gradient_[i / 4], i % 4);
  }

 private:
  template <int g>
  MPUCAL_APART void run_group(const Coefficients* steps, int count, Lane (*rows)[G]) {
    Lane s[3], P[6], gradient = gradient_[g];
    for (int a = 0; a < 3; ++a) s[a] = ds_[g][a];
    for (int m = 0; m < 6; ++m) P[m] = dP_[g][m];
    for (int i = 0; i < count; ++i) {
      const Coefficients& c = steps[i / 4];
      const int t = i % 4;
      Lane(*const of_four)[G] = rows + i / 4 * kRowsOfFour;
      if (t == 0) information_in_S<g>(c, P, of_four);
      measure<g>(c, t, s, P, gradient, of_four + 6 + 3 * t);
      Lane next_s[3], next_P[6];
      carry_s<g>(c, t, s, P, next_s);
      carry_P<g>(c, t, P, next_P);
      add_process_noise(c, t, next_s, next_P);
      for (int a = 0; a < 3; ++a) s[a] = next_s[a];
      for (int m = 0; m < 6; ++m) P[m] = next_P[m];
    }
    for (int a = 0; a < 3; ++a) ds_[g][a] = s[a];
    for (int m = 0; m < 6; ++m) dP_[g][m] = P[m];
    gradient_[g] = gradient;
  }

  // -L^-1 de, a row of the Fisher matrix for each component, and V
  template <int g>
  MPUCAL_INLINE static void measure(const Coefficients& c, int t, const Lane (&s)[3], const Lane (&P)[6],
                                    Lane& gradient, Lane (*rows)[G]) {
    Lane e[3];
    for (int a = 0; a < 3; ++a) {
      e[a] = madd(at(c.T[a][2], t), s[2], madd(at(c.T[a][1], t), s[1], at(c.T[a][0], t) * s[0]));
      if constexpr (g < 3)
        if (a >= g) e[a] = madd(at(c.white[a][g], t), c.q[t], e[a]);
      rows[a][g] = e[a];
    }
    Lane by_P = at(c.dV[0], t) * P[0], by_e = at(c.residual[0], t) * e[0];
    for (int m = 1; m < 6; ++m) by_P = madd(at(c.dV[m], t), P[m], by_P);
    for (int a = 1; a < 3; ++a) by_e = madd(at(c.residual[a], t), e[a], by_e);
    if constexpr (g < 3) by_P = by_P + c.dV_dD[t][g];
    gradient = gradient + (by_P - by_e);
  }

  // F N W (ds + dP z), what the parameters do of themselves in D and b_a, and eta x s
  template <int g>
  MPUCAL_INLINE static void carry_s(const Coefficients& c, int t, const Lane (&s)[3], const Lane (&P)[6],
                                    Lane (&out)[3]) {
    Lane x[3];
    for (int a = 0; a < 3; ++a) {
      x[a] = s[a];
      for (int b = 0; b < 3; ++b) x[a] = madd(at(c.z[b], t), P[kSym[a][b]], x[a]);
    }
    for (int a = 0; a < 3; ++a) {
      out[a] = madd(at(c.FNW[a][2], t), x[2], madd(at(c.FNW[a][1], t), x[1], at(c.FNW[a][0], t) * x[0]));
      if constexpr (g < 3)
        out[a] = nmadd(at(c.FNK[a][g], t), c.q_plus[t], madd(at(c.v[g], t), c.FNP[t][a], out[a]));
    }
    if constexpr (turns(g)) add_cross(eta<g>(c, t), at(c.s[0], t), at(c.s[1], t), at(c.s[2], t), out);
  }

  // F W dP (F W)' and the same for P; a row of F W dP serves its row of the product, and is done with
  template <int g>
  MPUCAL_INLINE static void carry_P(const Coefficients& c, int t, const Lane (&P)[6], Lane (&out)[6]) {
    for (int a = 0; a < 3; ++a) {
      Lane row[3];
      for (int b = 0; b < 3; ++b)
        row[b] = madd(at(c.FW[a][2], t), P[kSym[2][b]],
                      madd(at(c.FW[a][1], t), P[kSym[1][b]], at(c.FW[a][0], t) * P[kSym[0][b]]));
      for (int b = a; b < 3; ++b) {
        Lane& x = out[kSym[a][b]];
        x = madd(at(c.FW[b][2], t), row[2], madd(at(c.FW[b][1], t), row[1], at(c.FW[b][0], t) * row[0]));
        if constexpr (g < 3) x = nmadd(at(c.FK[b][g], t), c.FP[t][a], nmadd(at(c.FK[a][g], t), c.FP[t][b], x));
      }
    }
    if constexpr (turns(g)) add_turn(eta<g>(c, t), c, t, out);
  }

  // d(F x) = eta x (F x), for the groups that hold the gyro's parameters
  static constexpr bool turns(int g) {
    return g == Lanes::b_omega / 4 || (G > 5 && (g == Lanes::K / 4 || g == Lanes::K / 4 + 1));
  }
  template <int g>
  MPUCAL_INLINE static const Lane (&eta(const Coefficients& c, int t))[3] {
    if constexpr (g == Lanes::b_omega / 4) return c.eta_b[t];
    else if constexpr (g == Lanes::K / 4) return c.eta_K[t];
    else return c.eta_K2[t];
  }

  // [eta]x PF with its transpose
  MPUCAL_INLINE static void add_turn(const Lane (&n)[3], const Coefficients& c, int t, Lane (&P)[6]) {
    const double xx = at(c.PF[0], t), xy = at(c.PF[1], t), xz = at(c.PF[2], t);
    const double yy = at(c.PF[3], t), yz = at(c.PF[4], t), zz = at(c.PF[5], t);
    const Lane n2[3] = {n[0] + n[0], n[1] + n[1], n[2] + n[2]};
    P[0] = nmadd(xy, n2[2], madd(xz, n2[1], P[0]));
    P[3] = nmadd(yz, n2[0], madd(xy, n2[2], P[3]));
    P[5] = nmadd(xz, n2[1], madd(yz, n2[0], P[5]));
    P[1] = madd(xx - yy, n[2], nmadd(xz, n[0], madd(yz, n[1], P[1])));
    P[2] = madd(zz - xx, n[1], nmadd(yz, n[2], madd(xy, n[0], P[2])));
    P[4] = madd(yy - zz, n[0], nmadd(xy, n[1], madd(xz, n[2], P[4])));
  }

  // the derivative of [s]x diag(c) [s]x'
  MPUCAL_INLINE static void add_process_noise(const Coefficients& c, int t, const Lane (&s)[3], Lane (&P)[6]) {
    const Lane s2[3] = {s[0] + s[0], s[1] + s[1], s[2] + s[2]};
    P[0] = madd(at(c.sc[2][1], t), s2[2], madd(at(c.sc[1][2], t), s2[1], P[0]));
    P[3] = madd(at(c.sc[2][0], t), s2[2], madd(at(c.sc[0][2], t), s2[0], P[3]));
    P[5] = madd(at(c.sc[1][0], t), s2[1], madd(at(c.sc[0][1], t), s2[0], P[5]));
    P[1] = nmadd(at(c.sc[1][2], t), s[0], nmadd(at(c.sc[0][2], t), s[1], P[1]));
    P[2] = nmadd(at(c.sc[2][1], t), s[0], nmadd(at(c.sc[0][1], t), s[2], P[2]));
    P[4] = nmadd(at(c.sc[2][0], t), s[1], nmadd(at(c.sc[1][0], t), s[2], P[4]));
  }

  // L^-1 dS L^-T: six rows of the Fisher matrix's second term, 1/2 tr(S^-1 dS S^-1 dS). It is small beside the first
  // and changes slowly, so the first of four steps stands for four.
  template <int g>
  MPUCAL_INLINE static void information_in_S(const Coefficients& c, const Lane (&P)[6], Lane (*rows)[G]) {
    for (int a = 0; a < 3; ++a) {
      Lane row[3];
      for (int b = 0; b < 3; ++b)
        row[b] = madd(at(c.T[a][2], 0), P[kSym[2][b]],
                      madd(at(c.T[a][1], 0), P[kSym[1][b]], at(c.T[a][0], 0) * P[kSym[0][b]]));
      for (int b = a; b < 3; ++b) {
        Lane x = madd(at(c.T[b][2], 0), row[2], madd(at(c.T[b][1], 0), row[1], at(c.T[b][0], 0) * row[0]));
        if constexpr (g < 3) {
          if (a >= g) x = madd(at(c.white[a][g], 0), c.B[b], x);
          if (b >= g) x = madd(at(c.white[b][g], 0), c.B[a], x);
        }
        rows[kSym[a][b]][g] = (a == b ? 1.4142135623730951 : 2.0) * x;
      }
    }
  }

  Lane ds_[G][3], dP_[G][6], gradient_[G];
};
template <>
class Derivatives<0> {
 public:
  Derivatives(const Parameters&, const Constants&) {}
};

}  // namespace
}  // namespace mpucal
