// Recursion of the hand's x and P, a step at a time, with V.
//
// The four vectors of x, s and the chain's a, b and c, are the four places of a Lane, so that the chain is one 4 x 4
// matrix for all axes.
#pragma once
#include "hand_steps.hpp"

namespace mpucal {
namespace {  // each instruction set has its own copy

constexpr int kState = 4, kS = 0, kA = 1;  // places of s and a in (s, a, b, c)

// State before and effect of four measurements, one to a lane or [step]
struct HandPredicted {
  Lane s[3];                   // of x before the measurement
  Lane e[3], S[6], w;          // w: the robust weight
  Lane plus[3];                // s + K e
  Lane K[4][3][3];             // [step][axis][measurement], of (s, a, b, c)
  Lane x_next[4][3];           // [step][axis], before the next measurement
};

class HandRecursion {
 public:
  HandRecursion(const HandParameters& p, const HandConstants& c) : c_(c), threshold_(c.huber * c.huber) {
    for (int a = 0; a < 3; ++a) x_[a] = Lane{c.gravity * p.u[a], 0.0, 0.0, 0.0};
    for (auto& block : P_)
      for (auto& rows : block)
        for (Lane& row : rows) row = all(0.0);
  }

  double V() const { return V_; }
  double squares() const { return squares_; }

  // The next `count` steps. The flat mean, which begins them, is no sample: it has no robust weight, and is not among
  // the squares.
  template <bool kept>
  MPUCAL_APART void run(const HandSteps* steps, int count, bool flat, HandPredicted* predicted) {
    double determinants = 1.0, outliers = 1.0;
    for (int i = 0; i < count; ++i, flat = false) {
      const HandSteps& four = steps[i / 4];
      const int t = i % 4;
      double e[3], S[6], v[3], R[3];
      Lane A[3][3], K[3][3];
      cross_covariance(four, t, A);
      innovate(four, t, A, e, S, R);
      Adjugate<double> adjugate(S);
      multiply(adjugate.m, e, v);
      double reciprocal = 1.0 / adjugate.determinant;
      const double square = dot(e, v) * reciprocal;
      gather(determinants, adjugate.determinant, V_);
      if constexpr (kept) keep(e, S, t, predicted[i / 4]);
      const double w = flat ? plain(square) : weigh(square, outliers);
      if (!flat) squares_ += square;
      if (w < 1.0) {
        for (int a = 0; a < 3; ++a) S[kSym[a][a]] = madd(R[a], 1.0 / w - 1.0, S[kSym[a][a]]);
        adjugate = Adjugate<double>(S);
        reciprocal = 1.0 / adjugate.determinant;
      }
      gain(A, adjugate, reciprocal, e, K);
      if constexpr (kept) {
        HandPredicted& kept_four = predicted[i / 4];
        put(kept_four.w, t, w);
        for (int a = 0; a < 3; ++a) {
          put(kept_four.plus[a], t, at(x_[a], kS));
          for (int j = 0; j < 3; ++j) kept_four.K[t][a][j] = K[a][j];
        }
      }
      follow(four, t, A, K);
      if (at(four.reset, t) >= 0.0) reset(at(four.reset, t));
      if constexpr (kept)
        for (int a = 0; a < 3; ++a) predicted[i / 4].x_next[t][a] = x_[a];
    }
    V_ += 0.5 * std::log(determinants);
    if (outliers > 1.0) V_ += 0.5 * threshold_ * std::log(outliers);
  }

 private:
  // Covariance of x along an axis with a measurement
  MPUCAL_INLINE void cross_covariance(const HandSteps& four, int t, Lane (&A)[3][3]) const {
    for (int a = 0; a < 3; ++a)
      for (int j = 0; j < 3; ++j) {
        A[a][j] = at(four.Hs[j][0], t) * P_[0][a][kS];
        A[a][j] = madd(at(four.C[j][0], t), P_[0][a][kA], A[a][j]);
        for (int b = 1; b < 3; ++b)
          A[a][j] = madd(at(four.C[j][b], t), P_[b][a][kA], madd(at(four.Hs[j][b], t), P_[b][a][kS], A[a][j]));
      }
  }

  MPUCAL_INLINE void innovate(const HandSteps& four, int t, const Lane (&A)[3][3], double (&e)[3], double (&S)[6],
                              double (&R)[3]) const {
    for (int j = 0; j < 3; ++j) {
      R[j] = at(four.R[j], t);
      e[j] = at(four.y[j], t);
      for (int a = 0; a < 3; ++a)
        e[j] = nmadd(at(four.C[j][a], t), at(x_[a], kA), nmadd(at(four.Hs[j][a], t), at(x_[a], kS), e[j]));
    }
    for_each<6>([&](auto m) {
      constexpr int i = kRow[m], j = kCol[m];
      double by_s = i == j ? R[i] : 0.0, by_a = 0.0;
      for (int a = 0; a < 3; ++a) {
        by_s = madd(at(four.Hs[i][a], t), at(A[a][j], kS), by_s);
        by_a = madd(at(four.C[i][a], t), at(A[a][j], kA), by_a);
      }
      S[m] = by_s + by_a;
    });
  }

  MPUCAL_INLINE void keep(const double (&e)[3], const double (&S)[6], int t, HandPredicted& kept) const {
    for (int a = 0; a < 3; ++a) {
      put(kept.s[a], t, at(x_[a], kS));
      put(kept.e[a], t, e[a]);
    }
    for (int m = 0; m < 6; ++m) put(kept.S[m], t, S[m]);
  }

  // The weight, and rho added to V; the logarithm of the redescending rho is left to `outliers`
  MPUCAL_INLINE double weigh(double square, double& outliers) {
    if (!(square > threshold_)) return plain(square);
    if (c_.tail != 0.0) {
      V_ += 0.5 * threshold_;
      gather(outliers, square / threshold_, V_, threshold_);
      return threshold_ / square;
    }
    const double norm = std::sqrt(square);
    V_ += c_.huber * (norm - 0.5 * c_.huber);
    return c_.huber / norm;
  }
  MPUCAL_INLINE double plain(double square) {
    V_ += 0.5 * square;
    return 1.0;
  }

  // K = A S^-1; x + K e
  MPUCAL_INLINE void gain(const Lane (&A)[3][3], const Adjugate<double>& adjugate, double reciprocal,
                          const double (&e)[3], Lane (&K)[3][3]) {
    double inverse[6];
    for (int m = 0; m < 6; ++m) inverse[m] = reciprocal * adjugate.m[m];
    for (int a = 0; a < 3; ++a)
      for (int j = 0; j < 3; ++j) {
        K[a][j] = madd(inverse[kSym[2][j]], A[a][2],
                       madd(inverse[kSym[1][j]], A[a][1], inverse[kSym[0][j]] * A[a][0]));
        x_[a] = madd(e[j], K[a][j], x_[a]);
      }
  }

  // P <- Phi (P - K A') Phi' + noise of the jerk and of the gyroscope; restore the length of s, x <- Phi x. The length is
  // computed last, and so is all that depends on it.
  MPUCAL_INLINE void follow(const HandSteps& four, int t, const Lane (&A)[3][3], const Lane (&K)[3][3]) {
    const double Phi[3] = {at(four.chain.Phi[0], t), at(four.chain.Phi[1], t), at(four.chain.Phi[2], t)};
    for (int m = 0; m < 6; ++m) {
      const int a = kRow[m], b = kCol[m];
      Lane P[kState], X[kState];
      for (int i = 0; i < kState; ++i) {
        P[i] = P_[a][b][i];
        for (int j = 0; j < 3; ++j) P[i] = nmadd(at(K[a][j], i), A[b][j], P[i]);
      }
      chained(Phi, P);
      transpose(P[0], P[1], P[2], P[3], X[0], X[1], X[2], X[3]);
      chained(Phi, X);
      if (a == b) {
        for (int k = 0; k < 3; ++k) X[k + 1] = X[k + 1] + four.noise[t][k];
        for (int i = 0; i < kState; ++i) P_[a][a][i] = X[i];
      } else {
        P_[b][a][kS] = X[kS], P_[b][a][kA] = X[kA];
        transpose(X[0], X[1], X[2], X[3], P_[a][b][0], P_[a][b][1], P_[a][b][2], P_[a][b][3]);
      }
    }
    double s[3] = {at(x_[0], kS), at(x_[1], kS), at(x_[2], kS)}, N[6];
    const double stretch = c_.gravity / std::sqrt(dot(s, s));
    for (int a = 0; a < 3; ++a) {
      s[a] *= stretch;
      Lane x = Lane{s[a], 0.0, 0.0, 0.0};
      for (int k = 0; k < 3; ++k) x = madd(at(x_[a], k + 1), four.column[t][k], x);
      x_[a] = x;
    }
    process_noise(four, t, s, N);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) P_[a][b][kS] = P_[a][b][kS] + Lane{N[kSym[a][b]], 0.0, 0.0, 0.0};
  }

  // rows of (s, a, b, c) by Phi
  MPUCAL_INLINE static void chained(const double (&Phi)[3], Lane (&rows)[kState]) {
    rows[1] = madd(Phi[2], rows[3], madd(Phi[1], rows[2], Phi[0] * rows[1]));
    rows[2] = madd(Phi[1], rows[3], Phi[0] * rows[2]);
    rows[3] = Phi[0] * rows[3];
  }

  // [s]x c [s]x'
  MPUCAL_INLINE static void process_noise(const HandSteps& four, int t, const double (&s)[3], double (&N)[6]) {
    double c[6], X[3][3];
    for (int m = 0; m < 6; ++m) c[m] = at(four.c_first[m], t);
    for (int b = 0; b < 3; ++b) {
      X[0][b] = nmadd(s[2], c[kSym[1][b]], s[1] * c[kSym[2][b]]);
      X[1][b] = nmadd(s[0], c[kSym[2][b]], s[2] * c[kSym[0][b]]);
      X[2][b] = nmadd(s[1], c[kSym[0][b]], s[0] * c[kSym[1][b]]);
    }
    N[0] = nmadd(s[2], X[0][1], s[1] * X[0][2]);
    N[1] = nmadd(s[0], X[0][2], s[2] * X[0][0]);
    N[2] = nmadd(s[1], X[0][0], s[0] * X[0][1]);
    N[3] = nmadd(s[0], X[1][2], s[2] * X[1][0]);
    N[4] = nmadd(s[1], X[1][0], s[0] * X[1][1]);
    N[5] = nmadd(s[1], X[2][0], s[0] * X[2][1]);
  }

  // p = v = a = 0 and uncorrelated with s, each as far from it as in a long rest
  void reset(double sigma) {
    const Lane s_alone{1.0, 0.0, 0.0, 0.0};
    for (int a = 0; a < 3; ++a) {
      x_[a] = x_[a] * s_alone;
      for (auto& block : P_[a]) {
        block[kS] = block[kS] * s_alone;
        for (int k = 1; k < kState; ++k) block[k] = all(0.0);
      }
      const Lane s = P_[a][a][kS];
      Chain::rest(c_.lam, sigma, P_[a][a]);
      P_[a][a][kS] = s;
    }
  }

  const HandConstants& c_;
  const double threshold_;
  Lane x_[3];             // (s, a, b, c) along each axis
  Lane P_[3][3][kState];  // [a][b]: rows of (s, a, b, c) along a, lanes along b; where b < a, of s and a alone
  double V_ = 0.0, squares_ = 0.0;
};

}  // namespace
}  // namespace mpucal
