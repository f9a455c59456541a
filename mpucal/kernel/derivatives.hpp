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
      differentiate<g>(c, t, s, P, gradient, of_four + 6 + 3 * t);
    }
    for (int a = 0; a < 3; ++a) ds_[g][a] = s[a];
    for (int m = 0; m < 6; ++m) dP_[g][m] = P[m];
    gradient_[g] = gradient;
  }

  template <int g>
  MPUCAL_INLINE static void differentiate(const Coefficients& c, int t, Lane (&s)[3], Lane (&P)[6], Lane& gradient,
                                          Lane (*rows)[G]) {
    Lane e[3], new_s[3], new_P[6], x[3], WP[3][3];
    direct<g>(c, t, e, new_s, new_P);
    // L^-1 de, and V
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) e[a] = nmadd(at(c.T[a][b], t), s[b], e[a]);
      rows[a][g] = e[a];
    }
    Lane by_P = at(c.dV[0], t) * P[0], by_e = at(c.residual[0], t) * e[0];
    for (int m = 1; m < 6; ++m) by_P = madd(at(c.dV[m], t), P[m], by_P);
    for (int a = 1; a < 3; ++a) by_e = madd(at(c.residual[a], t), e[a], by_e);
    if constexpr (g < 3) by_P = by_P + c.dV_dD[t][g];
    gradient = gradient + (by_P + by_e);

    for (int a = 0; a < 3; ++a) {
      x[a] = s[a];
      for (int b = 0; b < 3; ++b) x[a] = madd(at(c.z[b], t), P[kSym[a][b]], x[a]);
    }
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) new_s[a] = madd(at(c.FNW[a][b], t), x[b], new_s[a]);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        WP[a][b] = madd(at(c.FW[a][2], t), P[kSym[2][b]],
                        madd(at(c.FW[a][1], t), P[kSym[1][b]], at(c.FW[a][0], t) * P[kSym[0][b]]));
    for (int m = 0; m < 6; ++m)
      for (int k = 0; k < 3; ++k) new_P[m] = madd(at(c.FW[kCol[m]][k], t), WP[kRow[m]][k], new_P[m]);
    add_process_noise(c, t, new_s, new_P);
    for (int a = 0; a < 3; ++a) s[a] = new_s[a];
    for (int m = 0; m < 6; ++m) P[m] = new_P[m];
  }

  // What the parameters do of themselves to L^-1 e, s and P
  template <int g>
  MPUCAL_INLINE static void direct(const Coefficients& c, int t, Lane (&e)[3], Lane (&s)[3], Lane (&P)[6]) {
    for (int a = 0; a < 3; ++a) e[a] = s[a] = all(0.0);
    for (int m = 0; m < 6; ++m) P[m] = all(0.0);
    if constexpr (g < 3) {
      for (int a = g; a < 3; ++a) e[a] = nmadd(at(c.white[a][g], t), c.q[t], e[a]);
      for (int a = 0; a < 3; ++a)
        s[a] = nmadd(at(c.FNK[a][g], t), c.q_plus[t], madd(at(c.v[g], t), c.FNP[t][a], s[a]));
      for (int m = 0; m < 6; ++m) {
        const int a = kRow[m], b = kCol[m];
        P[m] = nmadd(at(c.FK[b][g], t), c.FP[t][a], nmadd(at(c.FK[a][g], t), c.FP[t][b], P[m]));
      }
    }
    if constexpr (g == Lanes::b_omega / 4) add_turn(c.eta_b[t], c, t, s, P);
    if constexpr (G > 5 && g == Lanes::K / 4) add_turn(c.eta_K[t], c, t, s, P);
    if constexpr (G > 5 && g == Lanes::K / 4 + 1) add_turn(c.eta_K2[t], c, t, s, P);
  }

  // eta x s, and [eta]x PF with its transpose
  MPUCAL_INLINE static void add_turn(const Lane (&n)[3], const Coefficients& c, int t, Lane (&s)[3], Lane (&P)[6]) {
    add_cross(n, at(c.s[0], t), at(c.s[1], t), at(c.s[2], t), s);
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
    Lane TP[3][3];
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        TP[a][b] = madd(at(c.T[a][2], 0), P[kSym[2][b]],
                        madd(at(c.T[a][1], 0), P[kSym[1][b]], at(c.T[a][0], 0) * P[kSym[0][b]]));
    for (int m = 0; m < 6; ++m) {
      const int a = kRow[m], b = kCol[m];
      Lane M = madd(at(c.T[b][2], 0), TP[a][2], madd(at(c.T[b][1], 0), TP[a][1], at(c.T[b][0], 0) * TP[a][0]));
      if constexpr (g < 3) {
        if (a >= g) M = madd(at(c.white[a][g], 0), c.B[b], M);
        if (b >= g) M = madd(at(c.white[b][g], 0), c.B[a], M);
      }
      rows[m][g] = (a == b ? 1.4142135623730951 : 2.0) * M;
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
