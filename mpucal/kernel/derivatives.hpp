// Derivatives of s and P by the parameters, four parameters at a time, propagated step by step with the recursion.
#pragma once
#include "coefficients.hpp"
#include "fisher.hpp"

namespace mpucal {
namespace {  // each instruction set has its own copy

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
      put(ds_[Lanes::tilt / 4][a], Lanes::tilt % 4, c.gravity * p.du[0][a]);
      put(ds_[(Lanes::tilt + 1) / 4][a], (Lanes::tilt + 1) % 4, c.gravity * p.du[1][a]);
    }
  }

  // The next `count` steps; rows of the Fisher matrix, kRowsOfFour for four steps
  void run(const Coefficients* steps, int count, Lane (*rows)[G]) {
    for_each<(G + kGroupsAbreast - 1) / kGroupsAbreast>([&](auto i) {
      constexpr int first = kGroupsAbreast * i, left = G - first;
      run_groups<first, (left < kGroupsAbreast ? left : kGroupsAbreast)>(steps, count, rows);
    });
  }

  void write(double* gradient) const {
    for (int i = 0; i < 4 * G; ++i) gradient[i] = at(gradient_[i / 4], i % 4);
  }

 private:
  // `width` groups from `first` on: shared values are loaded once, and one group computes while the other waits.
  template <int first, int width>
  MPUCAL_APART void run_groups(const Coefficients* steps, int count, Lane (*rows)[G]) {
    Lane s[width][3], P[width][6], gradient[width];
    for (int w = 0; w < width; ++w) {
      for (int a = 0; a < 3; ++a) s[w][a] = ds_[first + w][a];
      for (int m = 0; m < 6; ++m) P[w][m] = dP_[first + w][m];
      gradient[w] = gradient_[first + w];
    }
    for (int i = 0; i < count; ++i) {
      const Coefficients& c = steps[i / 4];
      const int t = i % 4;
      Lane(*const of_four)[G] = rows + i / 4 * kRowsOfFour;
      if (t == 0) for_each<width>([&](auto w) { information_in_S<first + w>(c, P[w], of_four); });
      measure<first, width>(c, t, s, P, gradient, of_four + 6 + 3 * t);
      Lane next_s[width][3], next_P[width][6];
      carry_s<first, width>(c, t, s, P, next_s);
      carry_P<first, width>(c, t, P, next_P);
      add_process_noise<width>(c, t, next_s, next_P);
      for (int w = 0; w < width; ++w) {
        for (int a = 0; a < 3; ++a) s[w][a] = next_s[w][a];
        for (int m = 0; m < 6; ++m) P[w][m] = next_P[w][m];
      }
    }
    for (int w = 0; w < width; ++w) {
      for (int a = 0; a < 3; ++a) ds_[first + w][a] = s[w][a];
      for (int m = 0; m < 6; ++m) dP_[first + w][m] = P[w][m];
      gradient_[first + w] = gradient[w];
    }
  }

  // -L^-1 de, a row of the Fisher matrix for each component, and V
  template <int first, int width>
  MPUCAL_INLINE static void measure(const Coefficients& c, int t, const Lane (&s)[width][3], const Lane (&P)[width][6],
                                    Lane (&gradient)[width], Lane (*rows)[G]) {
    Lane e[width][3], by_P[width], by_e[width];
    for (int a = 0; a < 3; ++a) {
      product<width>(c.T[a], t, s, [&](int w) -> Lane& { return e[w][a]; });
      for_each<width>([&](auto w) {
        constexpr int g = first + w;
        if constexpr (g < 3)
          if (a >= g) e[w][a] = madd(at(c.white[a][g], t), c.q[t], e[w][a]);
        rows[a][g] = e[w][a];
      });
    }
    product<width>(c.dV, t, P, [&](int w) -> Lane& { return by_P[w]; });
    product<width>(c.residual, t, e, [&](int w) -> Lane& { return by_e[w]; });
    for_each<width>([&](auto w) {
      if constexpr (first + w < 3) by_P[w] = by_P[w] + c.dV_dD[t][first + w];
      gradient[w] = gradient[w] + (by_P[w] - by_e[w]);
    });
  }

  // out(w) = row . x[w]
  template <int width, int n, typename Out>
  MPUCAL_INLINE static void product(const Lane (&row)[n], int t, const Lane (&x)[width][n], Out out) {
    Lane sum[width];
    for (int k = 0; k < n; ++k) {
      const Lane factor = all(at(row[k], t));
      for (int w = 0; w < width; ++w) sum[w] = k ? madd(factor, x[w][k], sum[w]) : factor * x[w][k];
    }
    for (int w = 0; w < width; ++w) out(w) = sum[w];
  }

  // F N W (ds + dP z), the direct effect of D and b_a, and eta x s
  template <int first, int width>
  MPUCAL_INLINE static void carry_s(const Coefficients& c, int t, const Lane (&s)[width][3], const Lane (&P)[width][6],
                                    Lane (&out)[width][3]) {
    Lane x[width][3];
    for (int w = 0; w < width; ++w)
      for (int a = 0; a < 3; ++a) x[w][a] = s[w][a];
    for (int b = 0; b < 3; ++b) {
      const Lane z = all(at(c.z[b], t));
      for (int w = 0; w < width; ++w)
        for (int a = 0; a < 3; ++a) x[w][a] = madd(z, P[w][kSym[a][b]], x[w][a]);
    }
    for (int a = 0; a < 3; ++a) product<width>(c.FNW[a], t, x, [&](int w) -> Lane& { return out[w][a]; });
    for_each<width>([&](auto w) {
      constexpr int g = first + w;
      if constexpr (g < 3)
        for (int a = 0; a < 3; ++a)
          out[w][a] = nmadd(at(c.FNK[a][g], t), c.q_plus[t], madd(at(c.v[g], t), c.FNP[t][a], out[w][a]));
      if constexpr (turns(g)) add_cross(eta<g>(c, t), at(c.s[0], t), at(c.s[1], t), at(c.s[2], t), out[w]);
    });
  }

  // F W dP (F W)', and the direct effect of D
  template <int first, int width>
  MPUCAL_INLINE static void carry_P(const Coefficients& c, int t, const Lane (&P)[width][6], Lane (&out)[width][6]) {
    for (int m = 0; m < 6; ++m) {
      product<width>(c.carry[m], t, P, [&](int w) -> Lane& { return out[w][m]; });
      const int a = kRow[m], b = kCol[m];
      for_each<width>([&](auto w) {
        constexpr int g = first + w;
        if constexpr (g < 3)
          out[w][m] = nmadd(at(c.FK[b][g], t), c.FP[t][a], nmadd(at(c.FK[a][g], t), c.FP[t][b], out[w][m]));
      });
    }
    for_each<width>([&](auto w) {
      constexpr int g = first + w;
      if constexpr (turns(g)) add_turn(eta<g>(c, t), c, t, out[w]);
    });
  }

  // d(F x) = eta x (F x), for the groups that hold the gyro's parameters
  static constexpr bool turns(int g) {
    return g == Lanes::b_omega / 4 || (G > groups_of(LanesUsed::accel) && (g == Lanes::K / 4 || g == Lanes::K / 4 + 1));
  }
  template <int g>
  MPUCAL_INLINE static const Lane (&eta(const Coefficients& c, int t))[3] {
    if constexpr (g == Lanes::b_omega / 4) return c.eta_b[t];
    else if constexpr (g == Lanes::K / 4) return c.eta_K[t];
    else return c.eta_K2[t];
  }

  // [eta]x PF with its transpose
  MPUCAL_INLINE static void add_turn(const Lane (&n)[3], const Coefficients& c, int t, Lane (&P)[6]) {
    const double x = at(c.PF_beside[0], t), y = at(c.PF_beside[1], t), z = at(c.PF_beside[2], t);
    const Lane n2[3] = {n[0] + n[0], n[1] + n[1], n[2] + n[2]};
    P[0] = nmadd(z, n2[2], madd(y, n2[1], P[0]));
    P[3] = nmadd(x, n2[0], madd(z, n2[2], P[3]));
    P[5] = nmadd(y, n2[1], madd(x, n2[0], P[5]));
    P[1] = madd(at(c.PF_apart[2], t), n[2], nmadd(y, n[0], madd(x, n[1], P[1])));
    P[2] = madd(at(c.PF_apart[1], t), n[1], nmadd(x, n[2], madd(z, n[0], P[2])));
    P[4] = madd(at(c.PF_apart[0], t), n[0], nmadd(z, n[1], madd(y, n[2], P[4])));
  }

  // the derivative of [s]x diag(c) [s]x'
  template <int width>
  MPUCAL_INLINE static void add_process_noise(const Coefficients& c, int t, const Lane (&s)[width][3],
                                              Lane (&P)[width][6]) {
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        if (a != b) {
          // s_a c_b is in the diagonal's place of the third axis, and next to b.
          const int other = 3 - a - b;
          const Lane factor = all(at(c.sc[a][b], t));
          for (int w = 0; w < width; ++w) {
            Lane &diagonal = P[w][kSym[other][other]], &beside = P[w][kSym[a][other]];
            diagonal = madd(factor, s[w][a] + s[w][a], diagonal);
            beside = nmadd(factor, s[w][other], beside);
          }
        }
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
