// Lane: four doubles that are processed at once, in the widest registers of the build; with overloads for one double.
#pragma once
#include <cmath>
#include <type_traits>
#include <utility>

#if defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>
#endif

#if defined(__GNUC__) || defined(__clang__)
#define MPUCAL_INLINE __attribute__((always_inline)) inline
#define MPUCAL_APART __attribute__((noinline))
#else
#define MPUCAL_INLINE inline
#define MPUCAL_APART
#endif

namespace mpucal {
namespace {  // each instruction set has its own copy

#ifdef __FP_FAST_FMA
inline double madd(double x, double y, double z) { return __builtin_fma(x, y, z); }
inline double nmadd(double x, double y, double z) { return __builtin_fma(-x, y, z); }
#else
inline double madd(double x, double y, double z) { return x * y + z; }
inline double nmadd(double x, double y, double z) { return z - x * y; }
#endif
inline double root(double x) { return std::sqrt(x); }

#if defined(__AVX2__) && defined(__FMA__)

typedef double Lane __attribute__((vector_size(32)));
constexpr int kLanesInATile = 3;   // of the Fisher matrix: four times as many sums stay in registers
constexpr int kGroupsAbreast = 2;  // of derivatives: shared values are loaded once
inline Lane all(double x) { return Lane{x, x, x, x}; }
inline Lane madd(Lane x, Lane y, Lane z) { return (Lane)_mm256_fmadd_pd((__m256d)x, (__m256d)y, (__m256d)z); }
inline Lane nmadd(Lane x, Lane y, Lane z) { return (Lane)_mm256_fnmadd_pd((__m256d)x, (__m256d)y, (__m256d)z); }
inline Lane root(Lane x) { return (Lane)_mm256_sqrt_pd((__m256d)x); }

#else

// Two registers of 16 bytes (SSE2, NEON) where the compiler has vectors; any compiler supports pairs of doubles.
#if defined(__GNUC__) || defined(__clang__)
typedef double Pair __attribute__((vector_size(16)));
#else
struct Pair {
  double v[2];
  friend Pair operator+(Pair a, Pair b) { return {a.v[0] + b.v[0], a.v[1] + b.v[1]}; }
  friend Pair operator-(Pair a, Pair b) { return {a.v[0] - b.v[0], a.v[1] - b.v[1]}; }
  friend Pair operator*(Pair a, Pair b) { return {a.v[0] * b.v[0], a.v[1] * b.v[1]}; }
  friend Pair operator/(Pair a, Pair b) { return {a.v[0] / b.v[0], a.v[1] / b.v[1]}; }
};
#endif
struct Lane {
  Pair low, high;
  Lane() = default;
  Lane(double a, double b, double c, double d) : low{a, b}, high{c, d} {}
  Lane(Pair l, Pair h) : low(l), high(h) {}
};
constexpr int kLanesInATile = 1, kGroupsAbreast = 1;
inline Lane all(double x) { return {x, x, x, x}; }
inline Lane operator+(Lane a, Lane b) { return {a.low + b.low, a.high + b.high}; }
inline Lane operator-(Lane a, Lane b) { return {a.low - b.low, a.high - b.high}; }
inline Lane operator*(Lane a, Lane b) { return {a.low * b.low, a.high * b.high}; }
inline Lane operator/(Lane a, Lane b) { return {a.low / b.low, a.high / b.high}; }
inline Lane operator+(double a, Lane b) { return all(a) + b; }
inline Lane operator-(double a, Lane b) { return all(a) - b; }
inline Lane operator*(double a, Lane b) { return all(a) * b; }
inline Lane operator/(double a, Lane b) { return all(a) / b; }
inline Lane operator*(Lane a, double b) { return a * all(b); }
inline Lane madd(Lane x, Lane y, Lane z) { return x * y + z; }
inline Lane nmadd(Lane x, Lane y, Lane z) { return z - x * y; }
inline Lane root(Lane x) {
  const double *low = reinterpret_cast<const double*>(&x.low), *high = reinterpret_cast<const double*>(&x.high);
  return {std::sqrt(low[0]), std::sqrt(low[1]), std::sqrt(high[0]), std::sqrt(high[1])};
}

#endif

inline double at(const Lane& x, int i) { return reinterpret_cast<const double*>(&x)[i]; }
inline void put(Lane& x, int i, double value) { reinterpret_cast<double*>(&x)[i] = value; }

inline Lane lane(double x) { return all(x); }
inline Lane lane(Lane x) { return x; }

// x y + z and z - x y; a double stands for four times itself
template <typename X, typename Y, typename Z>
MPUCAL_INLINE Lane madd(X x, Y y, Z z) {
  return madd(lane(x), lane(y), lane(z));
}
template <typename X, typename Y, typename Z>
MPUCAL_INLINE Lane nmadd(X x, Y y, Z z) {
  return nmadd(lane(x), lane(y), lane(z));
}

// function(0), function(1) ... as constants
template <typename Function, int... g>
MPUCAL_INLINE void for_each(Function function, std::integer_sequence<int, g...>) {
  (function(std::integral_constant<int, g>{}), ...);
}
template <int count, typename Function>
MPUCAL_INLINE void for_each(Function function) {
  for_each(function, std::make_integer_sequence<int, count>{});
}

// Rows to columns: out[i] = a_i, b_i, c_i, d_i
MPUCAL_INLINE void transpose(Lane a, Lane b, Lane c, Lane d, Lane& out0, Lane& out1, Lane& out2, Lane& out3) {
#if defined(__AVX2__) && defined(__FMA__)
  const __m256d ab_even = _mm256_unpacklo_pd((__m256d)a, (__m256d)b), ab_odd = _mm256_unpackhi_pd((__m256d)a, (__m256d)b);
  const __m256d cd_even = _mm256_unpacklo_pd((__m256d)c, (__m256d)d), cd_odd = _mm256_unpackhi_pd((__m256d)c, (__m256d)d);
  out0 = (Lane)_mm256_permute2f128_pd(ab_even, cd_even, 0x20);
  out1 = (Lane)_mm256_permute2f128_pd(ab_odd, cd_odd, 0x20);
  out2 = (Lane)_mm256_permute2f128_pd(ab_even, cd_even, 0x31);
  out3 = (Lane)_mm256_permute2f128_pd(ab_odd, cd_odd, 0x31);
#else
  out0 = Lane{at(a, 0), at(b, 0), at(c, 0), at(d, 0)};
  out1 = Lane{at(a, 1), at(b, 1), at(c, 1), at(d, 1)};
  out2 = Lane{at(a, 2), at(b, 2), at(c, 2), at(d, 2)};
  out3 = Lane{at(a, 3), at(b, 3), at(c, 3), at(d, 3)};
#endif
}

}  // namespace
}  // namespace mpucal
