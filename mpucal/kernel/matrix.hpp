// Products of 3x3 matrices, of doubles or of Lanes.
#pragma once
#include <cmath>

#include "lane.hpp"

namespace mpucal {
namespace {  // each instruction set has its own copy

// A symmetric matrix is stored as xx, xy, xz, yy, yz, zz.
constexpr int kSym[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
constexpr int kRow[6] = {0, 0, 0, 1, 1, 2}, kCol[6] = {0, 1, 2, 1, 2, 2};

template <typename A, typename B>
MPUCAL_INLINE auto dot(const A (&a)[3], const B (&b)[3]) {
  return madd(a[2], b[2], madd(a[1], b[1], a[0] * b[0]));
}

// c = a b
template <typename A, typename B, typename C>
MPUCAL_INLINE void multiply(const A (&a)[3][3], const B (&b)[3][3], C (&c)[3][3]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c[i][j] = madd(a[i][2], b[2][j], madd(a[i][1], b[1][j], a[i][0] * b[0][j]));
}

// c = a b, b symmetric
template <typename A, typename B, typename C>
MPUCAL_INLINE void multiply(const A (&a)[3][3], const B (&b)[6], C (&c)[3][3]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      c[i][j] = madd(a[i][2], b[kSym[2][j]], madd(a[i][1], b[kSym[1][j]], a[i][0] * b[kSym[0][j]]));
}

// c = a b', known to be symmetric
template <typename A, typename B, typename C>
MPUCAL_INLINE void multiply_to_symmetric(const A (&a)[3][3], const B (&b)[3][3], C (&c)[6]) {
  for (int m = 0; m < 6; ++m) c[m] = dot(a[kRow[m]], b[kCol[m]]);
}

// c = a x
template <typename A, typename B, typename C>
MPUCAL_INLINE void multiply(const A (&a)[3][3], const B (&x)[3], C (&c)[3]) {
  for (int i = 0; i < 3; ++i) c[i] = dot(a[i], x);
}

// c = a b and c = a x, a a lower triangle
template <typename A, typename B, typename C>
MPUCAL_INLINE void multiply_lower(const A (&a)[3][3], const B (&b)[3][3], C (&c)[3][3]) {
  for (int j = 0; j < 3; ++j) {
    c[0][j] = a[0][0] * b[0][j];
    c[1][j] = madd(a[1][1], b[1][j], a[1][0] * b[0][j]);
    c[2][j] = madd(a[2][2], b[2][j], madd(a[2][1], b[1][j], a[2][0] * b[0][j]));
  }
}
template <typename A, typename B, typename C>
MPUCAL_INLINE void multiply_lower(const A (&a)[3][3], const B (&x)[3], C (&c)[3]) {
  c[0] = a[0][0] * x[0];
  c[1] = madd(a[1][1], x[1], a[1][0] * x[0]);
  c[2] = madd(a[2][2], x[2], madd(a[2][1], x[1], a[2][0] * x[0]));
}

// c = a' x
template <typename A, typename B, typename C>
MPUCAL_INLINE void multiply_transposed(const A (&a)[3][3], const B (&x)[3], C (&c)[3]) {
  for (int i = 0; i < 3; ++i) c[i] = madd(a[2][i], x[2], madd(a[1][i], x[1], a[0][i] * x[0]));
}

// C of a x a' = C x, x symmetric
template <typename T>
MPUCAL_INLINE void congruence(const T (&a)[3][3], T (&C)[6][6]) {
  for (int m = 0; m < 6; ++m)
    for (int n = 0; n < 6; ++n) {
      const auto &left = a[kRow[m]], &right = a[kCol[m]];
      const int k = kRow[n], l = kCol[n];
      C[m][n] = left[k] * right[l];
      if (k != l) C[m][n] = madd(left[l], right[k], C[m][n]);
    }
}

// c = a x, a symmetric
template <typename T>
MPUCAL_INLINE void multiply(const T (&a)[6], const T (&x)[3], T (&c)[3]) {
  for (int i = 0; i < 3; ++i) c[i] = madd(a[kSym[i][2]], x[2], madd(a[kSym[i][1]], x[1], a[kSym[i][0]] * x[0]));
}

// The inverse of a symmetric matrix is adjugate / determinant: products with the adjugate need not wait for the division.
template <typename T>
struct Adjugate {
  T m[6], determinant;

  MPUCAL_INLINE explicit Adjugate(const T (&S)[6]) {
    m[0] = nmadd(S[4], S[4], S[3] * S[5]);
    m[1] = nmadd(S[1], S[5], S[2] * S[4]);
    m[2] = nmadd(S[2], S[3], S[1] * S[4]);
    m[3] = nmadd(S[2], S[2], S[0] * S[5]);
    m[4] = nmadd(S[0], S[4], S[1] * S[2]);
    m[5] = nmadd(S[1], S[1], S[0] * S[3]);
    determinant = madd(S[2], m[2], madd(S[1], m[1], S[0] * m[0]));
  }
};

// L^-1 of S = L L', its lower triangle, from the leading minors: l_ii^2 = minor_i / minor_i-1; 1 / det S comes with it.
template <typename T>
MPUCAL_INLINE T whitener(const T (&S)[6], const Adjugate<T>& adjugate, T (&w)[3][3]) {
  const T one = S[0], two = adjugate.m[5], three = adjugate.determinant;
  const T reciprocal = 1.0 / (one * two * three), by_two = reciprocal * one * three;
  const T by_one = reciprocal * two * three, by_three = reciprocal * one * two;
  w[0][0] = root(by_one);
  w[1][1] = root(one * by_two);
  w[2][2] = root(two * by_three);
  w[1][0] = -1.0 * S[1] * by_one * w[1][1];
  w[2][0] = adjugate.m[2] * by_two * w[2][2];
  w[2][1] = adjugate.m[4] * by_two * w[2][2];
  return by_three;
}

// product *= factor; before it leaves the range of a double, half its logarithm goes to V. The branch is hardly ever taken.
MPUCAL_INLINE void gather(double& product, double factor, double& V, double weight = 1.0) {
  constexpr double smallest = 1e-150, largest = 1e150;
  product *= factor;
  if (!(product > smallest && product < largest)) {
    V += 0.5 * weight * std::log(product);
    product = 1.0;
  }
}

// Transpose values of four steps, one to a lane, to a vector for each step: out[step]
MPUCAL_INLINE void turn_round(const Lane (&x)[3], double last, Lane (&out)[4]) {
  transpose(x[0], x[1], x[2], all(last), out[0], out[1], out[2], out[3]);
}
MPUCAL_INLINE void turn_round(const Lane (&x)[3][3], Lane (&out)[4][3]) {
  for (int a = 0; a < 3; ++a) transpose(x[a][0], x[a][1], x[a][2], all(0.0), out[0][a], out[1][a], out[2][a], out[3][a]);
}

// J dK rate for each element of K, a vector for each step: of K_xx to K_xz in lanes 1 to 3, then of K_yy to K_zz
MPUCAL_INLINE void turn_by_K(const Lane (&J)[3][3], const Lane (&rate)[3], Lane (&x_row)[4][3], Lane (&others)[4][3]) {
  const Lane zero = all(0.0);
  for (int a = 0; a < 3; ++a) {
    const Lane xx = J[a][0] * rate[0], yy = J[a][1] * rate[1], zz = J[a][2] * rate[2];
    const Lane xy = madd(J[a][0], rate[1], J[a][1] * rate[0]);
    const Lane xz = madd(J[a][0], rate[2], J[a][2] * rate[0]);
    const Lane yz = madd(J[a][1], rate[2], J[a][2] * rate[1]);
    transpose(zero, zero - xx, zero - xy, zero - xz, x_row[0][a], x_row[1][a], x_row[2][a], x_row[3][a]);
    transpose(zero - yy, zero - yz, zero - zz, zero, others[0][a], others[1][a], others[2][a], others[3][a]);
  }
}

}  // namespace
}  // namespace mpucal
