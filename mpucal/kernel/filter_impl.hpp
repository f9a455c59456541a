// The filter's body, compiled once for each instruction set: the including file names the function.
#include <cmath>
#include <cstring>
#include <type_traits>
#include <utility>

#if defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>
#endif

#include "filter.hpp"
#include "rotation.hpp"

namespace mpucal {
namespace {

// Four doubles. Two builds hold them in one AVX2 register or in two of 16 bytes (SSE2, NEON); any compiler can loop.
#if defined(__AVX2__) && defined(__FMA__)
typedef double Lane __attribute__((vector_size(32)));
inline Lane all(double x) { return Lane{x, x, x, x}; }
inline Lane madd(Lane x, Lane y, Lane z) { return (Lane)_mm256_fmadd_pd((__m256d)x, (__m256d)y, (__m256d)z); }
#else
#if defined(__GNUC__) || defined(__clang__)
typedef double Pair __attribute__((vector_size(16)));
#else
struct Pair {
  double v[2];
  friend Pair operator+(Pair a, Pair b) { return {a.v[0] + b.v[0], a.v[1] + b.v[1]}; }
  friend Pair operator*(Pair a, Pair b) { return {a.v[0] * b.v[0], a.v[1] * b.v[1]}; }
};
#endif
struct Lane {
  Pair low, high;
  Lane() = default;
  Lane(double a, double b, double c, double d) : low{a, b}, high{c, d} {}
  Lane(Pair l, Pair h) : low(l), high(h) {}
  double& operator[](int i) { return reinterpret_cast<double*>(this)[i]; }
  double operator[](int i) const { return reinterpret_cast<const double*>(this)[i]; }
};
inline Lane operator+(Lane a, Lane b) { return {a.low + b.low, a.high + b.high}; }
inline Lane operator*(Lane a, Lane b) { return {a.low * b.low, a.high * b.high}; }
inline Lane all(double x) { return {x, x, x, x}; }
inline Lane madd(Lane x, Lane y, Lane z) { return x * y + z; }
#endif
#if defined(__GNUC__) || defined(__clang__)
#define MPUCAL_INLINE __attribute__((always_inline)) inline
#else
#define MPUCAL_INLINE inline
#endif

inline Lane madd(double x, Lane y, Lane z) { return madd(all(x), y, z); }

// A symmetric matrix is stored as xx, xy, xz, yy, yz, zz.
constexpr int kSym[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
constexpr int kRow[6] = {0, 0, 0, 1, 1, 2}, kCol[6] = {0, 1, 2, 1, 2, 2};

inline double dot(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

inline void multiply(const double (&a)[3][3], const double (&b)[3][3], double (&c)[3][3]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
}

// S = A D' + diag(R): determinant and inverse by the adjugate (one division on the recursion's path)
struct Inverse {
  double m[6], det;
};
inline Inverse invert(const double (&S)[6]) {
  const double c0 = S[3] * S[5] - S[4] * S[4], c1 = S[2] * S[4] - S[1] * S[5], c2 = S[1] * S[4] - S[2] * S[3];
  Inverse inverse;
  inverse.det = S[0] * c0 + S[1] * c1 + S[2] * c2;
  const double q = 1.0 / inverse.det;
  inverse.m[0] = c0 * q;
  inverse.m[1] = c1 * q;
  inverse.m[2] = c2 * q;
  inverse.m[3] = (S[0] * S[5] - S[2] * S[2]) * q;
  inverse.m[4] = (S[1] * S[2] - S[0] * S[4]) * q;
  inverse.m[5] = (S[0] * S[3] - S[1] * S[1]) * q;
  return inverse;
}

// L^-1 of S = L L', lower triangle
inline void whitener(const double (&S)[6], double (&w)[3][3]) {
  const double l00 = std::sqrt(S[0]), l10 = S[1] / l00, l20 = S[2] / l00;
  const double l11 = std::sqrt(S[3] - l10 * l10), l21 = (S[4] - l20 * l10) / l11;
  const double l22 = std::sqrt(S[5] - l20 * l20 - l21 * l21);
  w[0][0] = 1.0 / l00;
  w[1][1] = 1.0 / l11;
  w[2][2] = 1.0 / l22;
  w[1][0] = -l10 * w[0][0] * w[1][1];
  w[2][1] = -l21 * w[1][1] * w[2][2];
  w[2][0] = -(l20 * w[0][0] + l21 * w[1][0]) * w[2][2];
  w[0][1] = w[0][2] = w[1][2] = 0.0;
}

// Sum of logarithms as the logarithm of products, a few factors at a time
struct LogSum {
  double product = 1.0, sum = 0.0;
  int count = 0;
  void add(double x) {
    product *= x;
    if (++count == 8) flush();
  }
  void flush() {
    sum += std::log(product);
    product = 1.0;
    count = 0;
  }
};

// The Fisher matrix is a sum of outer products; gathered over some steps, and eight columns at a time, it stays in
// registers.
template <int G>
struct Fisher {
  static constexpr int kRows = 96, kMostInAStep = 9;
  Lane rows[kRows][G];
  Lane H[4 * G][G];
  int filled = 0;

  Fisher() { std::memset(static_cast<void*>(H), 0, sizeof H); }
  void make_room() {
    if (filled + kMostInAStep > kRows) flush();
  }
  template <int Wide>
  void tile(int i, int j) {
    Lane sum[4][Wide];
    for (int a = 0; a < 4; ++a)
      for (int b = 0; b < Wide; ++b) sum[a][b] = H[4 * i + a][j + b];
    for (int k = 0; k < filled; ++k) {
      const double* left = reinterpret_cast<const double*>(&rows[k][i]);
      for (int a = 0; a < 4; ++a)
        for (int b = 0; b < Wide; ++b) sum[a][b] = madd(left[a], rows[k][j + b], sum[a][b]);
    }
    for (int a = 0; a < 4; ++a)
      for (int b = 0; b < Wide; ++b) H[4 * i + a][j + b] = sum[a][b];
  }
  void flush() {
    for (int i = 0; i < G; ++i) {
      int j = i;
      for (; j + 1 < G; j += 2) tile<2>(i, j);
      if (j < G) tile<1>(i, j);
    }
    filled = 0;
  }
  void write(double* out) {
    flush();
    for (int i = 0; i < 4 * G; ++i)
      for (int j = i; j < 4 * G; ++j) out[i * 4 * G + j] = out[j * 4 * G + i] = H[i][j / 4][j % 4];
  }
};
template <>
struct Fisher<0> {};

// One measurement, as the derivatives need it.
struct Step {
  double q[3];                // s + L r
  double lever[3][3];         // L
  double R[3], noise;         // diagonal of R; its derivative by sigma_h
  double white[3][3];         // L^-1 of the nominal S
  double residual[3];         // L^-1 e
  double w;                   // Huber's weight
  double v[3];                // S^-1 e of the update
  double A[3][3], K[3][3];    // D P; gain of the update
  double P[6];                // after the update
  double N[3][3];             // derivative of the normalised s by s + K e
};

// n x (x, y, z)
inline void cross(const Lane (&n)[3], double x, double y, double z, Lane (&out)[3]) {
  out[0] = madd(z, n[1], all(-y) * n[2]);
  out[1] = madd(x, n[2], all(-z) * n[0]);
  out[2] = madd(y, n[0], all(-x) * n[1]);
}

template <int G>
class Filter {
  static constexpr bool kHand = G > Lanes::r / 4;

  template <typename Function, int... g>
  MPUCAL_INLINE static void each_of(Function function, std::integer_sequence<int, g...>) {
    (function(std::integral_constant<int, g>{}), ...);
  }
  template <typename Function>
  MPUCAL_INLINE static void each_group(Function function) {
    each_of(function, std::make_integer_sequence<int, G>{});
  }

 public:
  Filter(const Parameters& p, const Constants& c) : p_(p), c_(c) {
    for (int i = 0; i < 3; ++i) s_[i] = c.gravity * p.u[i];
    std::memset(P_, 0, sizeof P_);
    if constexpr (G > 0) {
      std::memset(static_cast<void*>(ds_), 0, sizeof ds_);
      std::memset(static_cast<void*>(dP_), 0, sizeof dP_);
      std::memset(static_cast<void*>(gradient_), 0, sizeof gradient_);
      for (int i = 0; i < 3; ++i) {
        ds_[Lanes::tilt0 / 4][i][Lanes::tilt0 % 4] = c.gravity * p.du[0][i];
        ds_[Lanes::tilt1 / 4][i][Lanes::tilt1 % 4] = c.gravity * p.du[1][i];
      }
    }
  }

  MPUCAL_INLINE void run(const Series& series, Result& result) {
    const double flat_scale = 1.0 / c_.flat_n;
    double squares = measure(c_.flat_y, flat_scale, 0.0, nullptr, nullptr, INFINITY, result, -1);
    double all_squares = 0.0;
    for (std::size_t i = 0; i < series.n; ++i) {
      propagate(series, i);
      squares = measure(series.y + 3 * i, series.r_scale ? series.r_scale[i] : 1.0,
                        series.motion ? series.motion[i] : 0.0, series.rate ? series.rate + 3 * i : nullptr,
                        series.alpha ? series.alpha + 3 * i : nullptr, c_.huber, result, static_cast<long>(i));
      all_squares += squares;
    }
    finish(result, all_squares);
  }

 private:
  // e, S and the update of s and P; returns e' S^-1 e
  MPUCAL_INLINE double measure(const double* y, double scale, double motion, const double* rate, const double* alpha, double huber,
                 Result& result, long i) {
    Step& k = step_;
    for (int a = 0; a < 3; ++a) k.q[a] = s_[a];
    if (rate) {
      lever(rate, alpha, k.lever);
      for (int a = 0; a < 3; ++a) k.q[a] += dot(k.lever[a], p_.r);
    } else if (kHand) {
      std::memset(k.lever, 0, sizeof k.lever);
    }
    if (i >= 0 && result.gravity) std::memcpy(result.gravity + 3 * i, s_, sizeof s_);
    double e[3], S[6];
    for (int a = 0; a < 3; ++a) e[a] = y[a] - dot(p_.D[a], k.q) - p_.b_a[a];
    k.noise = 2.0 * p_.sigma_h * motion;
    for (int a = 0; a < 3; ++a) {
      k.R[a] = scale * c_.Sigma_a[a] + p_.sigma_h * p_.sigma_h * motion;
      for (int b = 0; b < 3; ++b)
        k.A[a][b] = p_.D[a][0] * P_[kSym[0][b]] + p_.D[a][1] * P_[kSym[1][b]] + p_.D[a][2] * P_[kSym[2][b]];
    }
    for (int m = 0; m < 6; ++m) S[m] = dot(k.A[kRow[m]], p_.D[kCol[m]]);
    double nominal[6] = {S[0] + k.R[0], S[1], S[2], S[3] + k.R[1], S[4], S[5] + k.R[2]};
    Inverse inverse = invert(nominal);
    weigh(inverse, e, k.v);
    const double squares = dot(e, k.v);
    log_det_.add(inverse.det);
    k.w = 1.0;
    if (squares > huber * huber) {
      k.w = huber / std::sqrt(squares);
      V_ += huber * std::sqrt(squares) - 0.5 * huber * huber;
      const double inflated[6] = {S[0] + k.R[0] / k.w, S[1], S[2], S[3] + k.R[1] / k.w, S[4], S[5] + k.R[2] / k.w};
      inverse = invert(inflated);
      weigh(inverse, e, k.v);
    } else {
      V_ += 0.5 * squares;
    }
    if (G > 0 || result.innovation) {
      whitener(nominal, k.white);
      for (int a = 0; a < 3; ++a) k.residual[a] = dot(k.white[a], e);
      if (i >= 0 && result.innovation) std::memcpy(result.innovation + 3 * i, k.residual, sizeof k.residual);
    }
    update(inverse);
    return squares;
  }

  static void weigh(const Inverse& inverse, const double (&e)[3], double (&v)[3]) {
    for (int a = 0; a < 3; ++a)
      v[a] = inverse.m[kSym[a][0]] * e[0] + inverse.m[kSym[a][1]] * e[1] + inverse.m[kSym[a][2]] * e[2];
  }

  // [alpha]x + [omega]x^2
  static void lever(const double* w, const double* a, double (&L)[3][3]) {
    const double w2 = dot(w, w);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) L[i][j] = w[i] * w[j] - (i == j ? w2 : 0.0);
    L[0][1] -= a[2], L[1][0] += a[2];
    L[0][2] += a[1], L[2][0] -= a[1];
    L[1][2] -= a[0], L[2][1] += a[0];
  }

  MPUCAL_INLINE void update(const Inverse& inverse) {
    Step& k = step_;
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        k.K[a][b] = k.A[0][a] * inverse.m[kSym[0][b]] + k.A[1][a] * inverse.m[kSym[1][b]] +
                    k.A[2][a] * inverse.m[kSym[2][b]];
    for (int m = 0; m < 6; ++m) {
      const int a = kRow[m], b = kCol[m];
      k.P[m] = P_[m] - (k.K[a][0] * k.A[0][b] + k.K[a][1] * k.A[1][b] + k.K[a][2] * k.A[2][b]);
    }
    double plus[3];
    for (int a = 0; a < 3; ++a) plus[a] = s_[a] + k.A[0][a] * k.v[0] + k.A[1][a] * k.v[1] + k.A[2][a] * k.v[2];
    const double inverse_norm = 1.0 / std::sqrt(dot(plus, plus)), scale = c_.gravity * inverse_norm;
    for (int a = 0; a < 3; ++a) {
      const double direction = plus[a] * inverse_norm;
      s_[a] = c_.gravity * direction;
      for (int b = 0; b < 3; ++b)
        k.N[a][b] = scale * ((a == b ? 1.0 : 0.0) - direction * plus[b] * inverse_norm);
    }
  }

  MPUCAL_INLINE void propagate(const Series& series, std::size_t i) {
    const double dt = series.dt[i], *omega = series.omega + 3 * i;
    double rate[3], phi[3];
    for (int a = 0; a < 3; ++a) rate[a] = omega[a] - p_.b_omega[a];
    for (int a = 0; a < 3; ++a) phi[a] = -dt * dot(p_.K[a], rate);
    const Turn turn(phi);
    double moved[3], FP[3][3], PF[6];
    for (int a = 0; a < 3; ++a) {
      moved[a] = dot(turn.F[a], s_);
      for (int b = 0; b < 3; ++b)
        FP[a][b] = turn.F[a][0] * step_.P[kSym[0][b]] + turn.F[a][1] * step_.P[kSym[1][b]] +
                   turn.F[a][2] * step_.P[kSym[2][b]];
    }
    for (int m = 0; m < 6; ++m) PF[m] = dot(FP[kRow[m]], turn.F[kCol[m]]);
    double c[3];
    const double q_scale = dt * dt * (series.q_scale ? series.q_scale[i] : 1.0);
    for (int a = 0; a < 3; ++a) c[a] = q_scale * c_.Sigma_omega[a] + (series.q_extra ? series.q_extra[i] : 0.0);
    if constexpr (G > 0) {
      differentiate();
      transport(turn, rate, dt, moved, PF, FP, c);
    }
    std::memcpy(s_, moved, sizeof s_);
    const double *s = s_;
    P_[0] = PF[0] + s[2] * s[2] * c[1] + s[1] * s[1] * c[2];
    P_[3] = PF[3] + s[2] * s[2] * c[0] + s[0] * s[0] * c[2];
    P_[5] = PF[5] + s[1] * s[1] * c[0] + s[0] * s[0] * c[1];
    P_[1] = PF[1] - s[0] * s[1] * c[2];
    P_[2] = PF[2] - s[0] * s[2] * c[1];
    P_[4] = PF[4] - s[1] * s[2] * c[0];
  }

  // d(L^-1 e) and tr(S^-1 dS) of the last measurement, into the gradient and the Fisher matrix
  MPUCAL_INLINE void differentiate() {
    if constexpr (G > 0) {
      const Step& k = step_;
      double T[3][3], B[3][3], TL[3][3], z[3], Ct[6], Cq[6];
      multiply(k.white, p_.D, T);
      multiply(k.white, k.A, B);
      const double* r = k.residual;
      for (int a = 0; a < 3; ++a) z[a] = T[0][a] * r[0] + T[1][a] * r[1] + T[2][a] * r[2];
      // <X, Ct> is half tr(S^-1 D X D'), <X, Cq> is half of -r' L^-1 D X D' L^-T r
      for (int m = 0; m < 6; ++m) {
        const int a = kRow[m], b = kCol[m];
        const double twice = a == b ? 1.0 : 2.0;
        Ct[m] = 0.5 * twice * (T[0][a] * T[0][b] + T[1][a] * T[1][b] + T[2][a] * T[2][b]);
        Cq[m] = -0.5 * twice * z[a] * z[b];
      }
      const Lane q{k.q[0], k.q[1], k.q[2], 1.0};
      Lane row[3];
      for (int a = 0; a < 3; ++a) row[a] = Lane{B[a][0], B[a][1], B[a][2], 0.0};
      const Lane B_r = madd(r[2], row[2], madd(r[1], row[1], all(r[0]) * row[0]));
      const bool full = step_count_ % kFullEvery == 0;
      if constexpr (kHand) multiply(T, k.lever, TL);
      fisher_.make_room();
      Lane(*rows)[G] = fisher_.rows + fisher_.filled;
      const Lane root_w = all(k.w < 1.0 ? std::sqrt(k.w) : 1.0), w = all(k.w);
      const Differences d{T, TL, B_r, q, row, Ct, Cq, root_w, w, rows, full};
      each_group([&](auto g) { differentiate_group<g>(d); });
      fisher_.filled += full ? 9 : 3;
      ++step_count_;
    }
  }

  // What one step's derivatives share
  struct Differences {
    const double (&T)[3][3], (&TL)[3][3];
    Lane B_r, q;
    const Lane (&row)[3];
    const double (&Ct)[6], (&Cq)[6];
    Lane root_w, w;
    Lane (*rows)[G];
    bool full;
  };

  template <int g>
  MPUCAL_INLINE void differentiate_group(const Differences& d) {
    const Step& k = step_;
    const double* r = k.residual;
    const Lane* X = dP_[g];
    Lane eps[3];
    for (int a = 0; a < 3; ++a) {
      eps[a] = all(-d.T[a][0]) * ds_[g][0];
      eps[a] = madd(-d.T[a][1], ds_[g][1], eps[a]);
      eps[a] = madd(-d.T[a][2], ds_[g][2], eps[a]);
    }
    Lane half_trace = all(d.Ct[0]) * X[0], square = all(d.Cq[0]) * X[0];
    for (int m = 1; m < 6; ++m) {
      half_trace = madd(d.Ct[m], X[m], half_trace);
      square = madd(d.Cq[m], X[m], square);
    }
    if constexpr (g < 3) {
      double white_r = 0.0;
      for (int a = g; a < 3; ++a) {
        eps[a] = madd(-k.white[a][g], d.q, eps[a]);
        half_trace = madd(k.white[a][g], d.row[a], half_trace);
        white_r += k.white[a][g] * r[a];
      }
      square = madd(-white_r, d.B_r, square);
    }
    if constexpr (g == Lanes::r / 4)
      for (int a = 0; a < 3; ++a) eps[a] = eps[a] + Lane{-d.TL[a][0], -d.TL[a][1], -d.TL[a][2], 0.0};
    if constexpr (kHand && g == Lanes::sigma_h / 4) {
      double trace = 0.0, along = 0.0;  // of L^-1 L^-T, and r' of it r
      for (int b = 0; b < 3; ++b) {
        double column = 0.0;
        for (int a = 0; a < 3; ++a) {
          trace += k.white[a][b] * k.white[a][b];
          column += k.white[a][b] * r[a];
        }
        along += column * column;
      }
      half_trace = half_trace + Lane{0.0, 0.0, 0.0, 0.5 * k.noise * trace};
      square = square + Lane{0.0, 0.0, 0.0, -0.5 * k.noise * along};
    }
    square = madd(r[0], eps[0], square);
    square = madd(r[1], eps[1], square);
    square = madd(r[2], eps[2], square);
    square_[g] = square;
    gradient_[g] = gradient_[g] + madd(d.w, square, half_trace);
    for (int a = 0; a < 3; ++a) d.rows[a][g] = d.root_w * eps[a];
    if (d.full) information_in_S<g>(d);
  }

  // L^-1 dS L^-T: six rows of the Fisher matrix's second term, 1/2 tr(S^-1 dS S^-1 dS). It is small beside the first
  // and changes slowly, so every fourth step stands for four.
  static constexpr int kFullEvery = 4;
  template <int g>
  MPUCAL_INLINE void information_in_S(const Differences& d) {
      const Step& k = step_;
      const Lane* X = dP_[g];
      Lane TX[3][3], M[6];
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) {
          TX[a][b] = all(d.T[a][0]) * X[kSym[0][b]];
          TX[a][b] = madd(d.T[a][1], X[kSym[1][b]], TX[a][b]);
          TX[a][b] = madd(d.T[a][2], X[kSym[2][b]], TX[a][b]);
        }
      for (int m = 0; m < 6; ++m) {
        const int a = kRow[m], b = kCol[m];
        M[m] = all(d.T[b][0]) * TX[a][0];
        M[m] = madd(d.T[b][1], TX[a][1], M[m]);
        M[m] = madd(d.T[b][2], TX[a][2], M[m]);
        if constexpr (g < 3) {
          M[m] = madd(k.white[a][g], d.row[b], M[m]);
          M[m] = madd(k.white[b][g], d.row[a], M[m]);
        }
        if constexpr (kHand && g == Lanes::sigma_h / 4)
          M[m] = M[m] + Lane{0.0, 0.0, 0.0, k.noise * dot(k.white[a], k.white[b])};
        d.rows[3 + m][g] = all(std::sqrt((a == b ? 0.5 : 1.0) * kFullEvery)) * M[m];
      }
  }

  // ds and dP through the update and the turn: with W = I - K D,
  //   ds+ = W (ds + dP D' v) + (direct),  dP+ = W dP W' + (direct),  then F and the derivative of F
  MPUCAL_INLINE void transport(const Turn& turn, const double (&rate)[3], double dt, const double (&moved)[3], const double (&PF)[6],
                 const double (&FP)[3][3], const double (&c)[3]) {
    if constexpr (G > 0) {
      const Step& k = step_;
      double W[3][3], FW[3][3], FN[3][3], FNW[3][3], FK[3][3], FNK[3][3], z[3], delta[3];
      for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b)
          W[a][b] = (a == b ? 1.0 : 0.0) - (k.K[a][0] * p_.D[0][b] + k.K[a][1] * p_.D[1][b] + k.K[a][2] * p_.D[2][b]);
        z[a] = p_.D[0][a] * k.v[0] + p_.D[1][a] * k.v[1] + p_.D[2][a] * k.v[2];
        delta[a] = k.A[0][a] * k.v[0] + k.A[1][a] * k.v[1] + k.A[2][a] * k.v[2];
      }
      multiply(turn.F, W, FW);
      multiply(turn.F, k.N, FN);
      multiply(FN, W, FNW);
      multiply(turn.F, k.K, FK);
      multiply(FN, k.K, FNK);
      const Lane q{k.q[0] + delta[0], k.q[1] + delta[1], k.q[2] + delta[2], 1.0};
      Lane FP4[3], FNP4[3];
      for (int a = 0; a < 3; ++a) {
        FP4[a] = Lane{FP[a][0], FP[a][1], FP[a][2], 0.0};
        double x[3];
        for (int b = 0; b < 3; ++b)
          x[b] = FN[a][0] * k.P[kSym[0][b]] + FN[a][1] * k.P[kSym[1][b]] + FN[a][2] * k.P[kSym[2][b]];
        FNP4[a] = Lane{x[0], x[1], x[2], 0.0};
      }
      // a weight below one divides R, and changes with theta
      const bool robust = k.w < 1.0;
      double robust_s[3] = {0, 0, 0}, robust_P[6] = {0, 0, 0, 0, 0, 0};
      if (robust) {
        const double kappa = 1.0 / (dot(k.residual, k.residual) * k.w);
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b) robust_s[a] -= kappa * FNK[a][b] * k.R[b] * k.v[b];
        for (int m = 0; m < 6; ++m)
          for (int b = 0; b < 3; ++b) robust_P[m] += kappa * FK[kRow[m]][b] * k.R[b] * FK[kCol[m]][b];
      }
      Lane eta[3][3];
      turning(turn, rate, dt, eta);
      const Moves m{FW, FNW, FK, FNK, z, q, FP4, FNP4, robust, robust_s, robust_P, eta, moved, PF, c};
      each_group([&](auto g) { transport_group<g>(m); });
    }
  }

  struct Moves {
    const double (&FW)[3][3], (&FNW)[3][3], (&FK)[3][3], (&FNK)[3][3], (&z)[3];
    Lane q;
    const Lane (&FP4)[3], (&FNP4)[3];
    bool robust;
    const double (&robust_s)[3], (&robust_P)[6];
    const Lane (&eta)[3][3];
    const double (&moved)[3], (&PF)[6], (&c)[3];
  };

  template <int g>
  MPUCAL_INLINE void transport_group(const Moves& m) {
    const Step& k = step_;
    Lane* X = dP_[g];
    Lane x[3], s[3], GX[3][3], Y[6];
    for (int a = 0; a < 3; ++a) {
      x[a] = madd(m.z[0], X[kSym[a][0]], ds_[g][a]);
      x[a] = madd(m.z[1], X[kSym[a][1]], x[a]);
      x[a] = madd(m.z[2], X[kSym[a][2]], x[a]);
    }
    for (int a = 0; a < 3; ++a) {
      s[a] = all(m.FNW[a][0]) * x[0];
      s[a] = madd(m.FNW[a][1], x[1], s[a]);
      s[a] = madd(m.FNW[a][2], x[2], s[a]);
      for (int b = 0; b < 3; ++b) {
        GX[a][b] = all(m.FW[a][0]) * X[kSym[0][b]];
        GX[a][b] = madd(m.FW[a][1], X[kSym[1][b]], GX[a][b]);
        GX[a][b] = madd(m.FW[a][2], X[kSym[2][b]], GX[a][b]);
      }
    }
    for (int i = 0; i < 6; ++i) {
      const int a = kRow[i], b = kCol[i];
      Y[i] = all(m.FW[b][0]) * GX[a][0];
      Y[i] = madd(m.FW[b][1], GX[a][1], Y[i]);
      Y[i] = madd(m.FW[b][2], GX[a][2], Y[i]);
    }
    if constexpr (g < 3) {
      for (int a = 0; a < 3; ++a) {
        s[a] = madd(k.v[g], m.FNP4[a], s[a]);
        s[a] = madd(-m.FNK[a][g], m.q, s[a]);
      }
      for (int i = 0; i < 6; ++i) {
        const int a = kRow[i], b = kCol[i];
        Y[i] = madd(-m.FK[a][g], m.FP4[b], Y[i]);
        Y[i] = madd(-m.FK[b][g], m.FP4[a], Y[i]);
      }
    }
    if constexpr (g == Lanes::r / 4) {
      double DL[3][3], x[3][3];
      multiply(p_.D, k.lever, DL);
      multiply(m.FNK, DL, x);
      for (int a = 0; a < 3; ++a) s[a] = s[a] + Lane{-x[a][0], -x[a][1], -x[a][2], 0.0};
    }
    if constexpr (kHand && g == Lanes::sigma_h / 4) {
      const double noise = k.noise / k.w;
      for (int a = 0; a < 3; ++a) s[a] = s[a] + Lane{0.0, 0.0, 0.0, -noise * dot(m.FNK[a], k.v)};
      for (int i = 0; i < 6; ++i) Y[i] = Y[i] + Lane{0.0, 0.0, 0.0, noise * dot(m.FK[kRow[i]], m.FK[kCol[i]])};
    }
    if (m.robust) {
      for (int a = 0; a < 3; ++a) s[a] = madd(m.robust_s[a], square_[g], s[a]);
      for (int i = 0; i < 6; ++i) Y[i] = madd(m.robust_P[i], square_[g], Y[i]);
    }
    if constexpr (g >= Lanes::b_omega / 4 && g <= Lanes::sigma_h / 4) {
      // eta x s, and [eta]x PF + (its transpose)
      const Lane(&n)[3] = m.eta[g - Lanes::b_omega / 4];
      Lane turned[3], C0[3], C1[3], C2[3];
      cross(n, m.moved[0], m.moved[1], m.moved[2], turned);
      cross(n, m.PF[0], m.PF[1], m.PF[2], C0);
      cross(n, m.PF[1], m.PF[3], m.PF[4], C1);
      cross(n, m.PF[2], m.PF[4], m.PF[5], C2);
      for (int a = 0; a < 3; ++a) s[a] = s[a] + turned[a];
      Y[0] = Y[0] + C0[0] + C0[0];
      Y[1] = Y[1] + C0[1] + C1[0];
      Y[2] = Y[2] + C0[2] + C2[0];
      Y[3] = Y[3] + C1[1] + C1[1];
      Y[4] = Y[4] + C1[2] + C2[1];
      Y[5] = Y[5] + C2[2] + C2[2];
    }
    // the derivative of [s]x diag(c) [s]x'
    const double *t = m.moved, *c = m.c;
    Y[0] = madd(2.0 * t[2] * c[1], s[2], madd(2.0 * t[1] * c[2], s[1], Y[0]));
    Y[3] = madd(2.0 * t[2] * c[0], s[2], madd(2.0 * t[0] * c[2], s[0], Y[3]));
    Y[5] = madd(2.0 * t[1] * c[0], s[1], madd(2.0 * t[0] * c[1], s[0], Y[5]));
    Y[1] = madd(-t[1] * c[2], s[0], madd(-t[0] * c[2], s[1], Y[1]));
    Y[2] = madd(-t[2] * c[1], s[0], madd(-t[0] * c[1], s[2], Y[2]));
    Y[4] = madd(-t[2] * c[0], s[1], madd(-t[1] * c[0], s[2], Y[4]));
    for (int a = 0; a < 3; ++a) ds_[g][a] = s[a];
    for (int i = 0; i < 6; ++i) X[i] = Y[i];
  }

  // d(exp([phi]x) x) = eta x (exp([phi]x) x), eta = J_l(phi) dphi, for the three groups that hold the gyro's parameters
  MPUCAL_INLINE void turning(const Turn& turn, const double (&rate)[3], double dt, Lane (&eta)[3][3]) {
    double J[3][3], JK[3][3], j[3];
    turn.left_jacobian(J);
    multiply(J, p_.K, JK);
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) j[b] = -dt * J[a][b];
      eta[0][a] = Lane{dt * JK[a][0], dt * JK[a][1], dt * JK[a][2], 0.0};
      eta[1][a] = Lane{0.0, j[0] * rate[0], j[0] * rate[1] + j[1] * rate[0], j[0] * rate[2] + j[2] * rate[0]};
      eta[2][a] = Lane{j[1] * rate[1], j[1] * rate[2] + j[2] * rate[1], j[2] * rate[2], 0.0};
    }
  }

  void finish(Result& result, double squares) {
    log_det_.flush();
    result.V = V_ + 0.5 * log_det_.sum;
    result.squares = squares;
    if constexpr (G > 0) {
      differentiate();
      std::memcpy(result.gradient, gradient_, sizeof gradient_);
      fisher_.write(result.fisher);
    }
  }

  const Parameters& p_;
  const Constants& c_;
  double s_[3], P_[6], V_ = 0.0;
  LogSum log_det_;
  Step step_;
  Lane ds_[G ? G : 1][3], dP_[G ? G : 1][6], gradient_[G ? G : 1], square_[G ? G : 1];
  Fisher<G> fisher_;
  unsigned step_count_ = 0;
};

template <int G>
void run(const Parameters& p, const Series& series, const Constants& c, Result& result) {
  Filter<G>(p, c).run(series, result);
}

}  // namespace

void MPUCAL_EVALUATE(const Parameters& p, const Series& series, const Constants& c, int groups, Result& result) {
  switch (groups) {
    case 0: return run<0>(p, series, c, result);
    case 5: return run<5>(p, series, c, result);
    case 6: return run<6>(p, series, c, result);
    default: return run<7>(p, series, c, result);
  }
}

}  // namespace mpucal
