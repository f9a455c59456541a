// The recursion of s and P, a step at a time, and V along it. Each step waits for the one before: what can be known
// without s and P is in Steps, and what only the derivatives need is left to them.
#pragma once
#include "steps.hpp"

namespace mpucal {
namespace {  // each build of the filter keeps its own

// s and P before the measurement of four steps, one to a lane; Huber's weight of it
struct Predicted {
  Lane s[3], P[6], w;
};

class Recursion {
 public:
  Recursion(const Parameters& p, const Constants& c) : p_(p), c_(c) {
    for (int a = 0; a < 3; ++a) s_[a] = c.gravity * p.u[a];
  }

  double V() const { return V_; }
  double squares() const { return squares_; }

  // The next `count` steps; the flat mean, which begins them, is not a sample: no Huber, not among the squares
  template <bool kept>
  MPUCAL_APART void run(const Steps* steps, int count, bool flat, Predicted* predicted) {
    double s[3] = {s_[0], s_[1], s_[2]}, P[6] = {P_[0], P_[1], P_[2], P_[3], P_[4], P_[5]};
    double V = 0.0, squares = 0.0, determinants = 1.0;
    for (int i = 0; i < count; ++i, flat = false) {
      const Steps& four = steps[i / 4];
      const int t = i % 4;
      if constexpr (kept) {
        for (int a = 0; a < 3; ++a) put(predicted[i / 4].s[a], t, s[a]);
        for (int m = 0; m < 6; ++m) put(predicted[i / 4].P[m], t, P[m]);
      }
      const double huber = flat ? INFINITY : c_.huber;
      double A[3][3], S[6], e[3], S_e[3], w = 1.0;
      const double R[3] = {at(four.R[0], t), at(four.R[1], t), at(four.R[2], t)};
      multiply(p_.D, P, A);
      multiply_to_symmetric(A, p_.D, R, S);
      for (int a = 0; a < 3; ++a)
        e[a] = nmadd(p_.D[a][2], s[2], nmadd(p_.D[a][1], s[1], nmadd(p_.D[a][0], s[0], at(four.y[a], t))));
      Adjugate<double> adjugate(S);
      multiply(adjugate.m, e, S_e);
      double reciprocal = 1.0 / adjugate.determinant;
      const double square = dot(e, S_e) * reciprocal;
      determinants *= adjugate.determinant;
      squares += flat ? 0.0 : square;
      if (square > huber * huber) {
        const double norm = std::sqrt(square);
        w = huber / norm;
        V += huber * (norm - 0.5 * huber);
        for (int a = 0; a < 3; ++a) S[kSym[a][a]] = madd(R[a], 1.0 / w - 1.0, S[kSym[a][a]]);
        adjugate = Adjugate<double>(S);
        multiply(adjugate.m, e, S_e);
        reciprocal = 1.0 / adjugate.determinant;
      } else {
        V += 0.5 * square;
      }
      if constexpr (kept) put(predicted[i / 4].w, t, w);
      update(A, adjugate, S_e, reciprocal, s, P);
      turn(four, t, s, P);
    }
    V_ += V + 0.5 * std::log(determinants);
    squares_ += squares;
    for (int a = 0; a < 3; ++a) s_[a] = s[a];
    for (int m = 0; m < 6; ++m) P_[m] = P[m];
  }

 private:
  // s + A' S^-1 e and P - A' S^-1 A, with S^-1 = adjugate times reciprocal
  MPUCAL_INLINE static void update(const double (&A)[3][3], const Adjugate<double>& adjugate, const double (&S_e)[3],
                                   double reciprocal, double (&s)[3], double (&P)[6]) {
    double A_S_e[3], S_A[3][3];
    multiply_transposed(A, S_e, A_S_e);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        S_A[a][b] = madd(adjugate.m[kSym[a][2]], A[2][b],
                         madd(adjugate.m[kSym[a][1]], A[1][b], adjugate.m[kSym[a][0]] * A[0][b]));
    for (int m = 0; m < 6; ++m) {
      const int a = kRow[m], b = kCol[m];
      P[m] = nmadd(madd(A[2][a], S_A[2][b], madd(A[1][a], S_A[1][b], A[0][a] * S_A[0][b])), reciprocal, P[m]);
    }
    for (int a = 0; a < 3; ++a) s[a] = madd(A_S_e[a], reciprocal, s[a]);
  }

  // F g s / |s| and F P F' + Q. A turn keeps lengths, so Q = [s]x diag(c) [s]x' may be taken before s has its length.
  MPUCAL_INLINE void turn(const Steps& four, int t, double (&s)[3], double (&P)[6]) const {
    double F[3][3], FP[3][3], x[3];
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) F[a][b] = at(four.turn.F[a][b], t);
    const double stretch2 = c_.gravity * c_.gravity / dot(s, s), stretch = std::sqrt(stretch2);
    multiply(F, s, x);
    multiply(F, P, FP);
    multiply_to_symmetric(FP, F, P);
    const double c[3] = {at(four.c[0], t), at(four.c[1], t), at(four.c[2], t)};
    P[0] = madd(stretch2, madd(c[1] * x[2], x[2], c[2] * x[1] * x[1]), P[0]);
    P[3] = madd(stretch2, madd(c[0] * x[2], x[2], c[2] * x[0] * x[0]), P[3]);
    P[5] = madd(stretch2, madd(c[0] * x[1], x[1], c[1] * x[0] * x[0]), P[5]);
    P[1] = nmadd(stretch2, c[2] * x[0] * x[1], P[1]);
    P[2] = nmadd(stretch2, c[1] * x[0] * x[2], P[2]);
    P[4] = nmadd(stretch2, c[0] * x[1] * x[2], P[4]);
    for (int a = 0; a < 3; ++a) s[a] = stretch * x[a];
  }

  const Parameters& p_;
  const Constants& c_;
  double s_[3], P_[6] = {0, 0, 0, 0, 0, 0};
  double V_ = 0.0, squares_ = 0.0;
};

}  // namespace
}  // namespace mpucal
