// exp([phi]x) and its left Jacobian. Steps are small, so that short series suffice; large steps use the closed form.
#pragma once
#include <cmath>

#include "matrix.hpp"

namespace mpucal {
namespace {  // each instruction set has its own copy

// M += factor [v]x
template <typename T>
MPUCAL_INLINE void add_cross(T (&M)[3][3], T factor, const T (&v)[3]) {
  M[0][1] = nmadd(factor, v[2], M[0][1]), M[1][0] = madd(factor, v[2], M[1][0]);
  M[2][0] = nmadd(factor, v[1], M[2][0]), M[0][2] = madd(factor, v[1], M[0][2]);
  M[1][2] = nmadd(factor, v[0], M[1][2]), M[2][1] = madd(factor, v[0], M[2][1]);
}

// sin x / x, (1 - cos x) / x^2, (x - sin x) / x^3 of x^2
template <typename T>
struct TurnFactors {
  T a, b, c;
};

// Remainders are below 1e-17 for x < 1/4.
constexpr double kSmall = 0.0625;
template <typename T>
MPUCAL_INLINE TurnFactors<T> small_turn(T x2) {
  const T y = -1.0 * x2;
  TurnFactors<T> f;
  f.b = madd(y, madd(y, madd(y, 1.0 / 479001600, 1.0 / 3628800), 1.0 / 40320), 1.0 / 720);
  f.b = madd(y, madd(y, f.b, 1.0 / 24), 0.5);
  f.c = madd(y, madd(y, madd(y, 1.0 / 39916800, 1.0 / 362880), 1.0 / 5040), 1.0 / 120);
  f.c = madd(y, f.c, 1.0 / 6);
  f.a = madd(y, f.c, 1.0);
  return f;
}

inline TurnFactors<double> turn_factors(double x2) {
  if (x2 < kSmall) return small_turn(x2);
  const double x = std::sqrt(x2), half = std::sin(0.5 * x), a = std::sin(x) / x;
  return {a, 2.0 * half * half / x2, (1.0 - a) / x2};
}

MPUCAL_APART inline TurnFactors<Lane> any_turn(const Lane& x2) {
  TurnFactors<Lane> lanes;
  for (int i = 0; i < 4; ++i) {
    const TurnFactors<double> one = turn_factors(at(x2, i));
    put(lanes.a, i, one.a), put(lanes.b, i, one.b), put(lanes.c, i, one.c);
  }
  return lanes;
}

MPUCAL_INLINE TurnFactors<Lane> turn_factors(const Lane& x2) {
  for (int i = 0; i < 4; ++i)
    if (!(at(x2, i) < kSmall)) return any_turn(x2);
  return small_turn(x2);
}

template <typename T>
struct Turn {
  T phi[3], F[3][3];
  TurnFactors<T> factors;

  // of the angle phi
  MPUCAL_INLINE void compute() {
    const T x2 = dot(phi, phi);
    factors = turn_factors(x2);
    square(factors.b, 1.0 - factors.b * x2, F);
    add_cross(F, factors.a, phi);
  }

  MPUCAL_INLINE void left_jacobian(T (&J)[3][3]) const {
    square(factors.c, factors.a, J);
    add_cross(J, factors.b, phi);
  }

 private:
  // M = x phi phi' + y I
  MPUCAL_INLINE void square(T x, T y, T (&M)[3][3]) const {
    for (int i = 0; i < 3; ++i) {
      const T scaled = x * phi[i];
      M[i][i] = madd(scaled, phi[i], y);
      for (int j = i + 1; j < 3; ++j) M[i][j] = M[j][i] = scaled * phi[j];
    }
  }
};

}  // namespace
}  // namespace mpucal
