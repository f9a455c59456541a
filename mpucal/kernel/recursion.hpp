// Recursion of s and P, a step at a time, with V. Each step depends on the one before: values that do not depend on s and
// P are in Steps, and values for the derivatives alone are computed there.
//
// It runs in the accelerometer's axes, m = D s and M = D P D', where a measurement is simple:
//   S = M + R,  e = y - m,  m <- m + M S^-1 e = y - R S^-1 e,  M <- M - M S^-1 M = R - R S^-1 R
// and where the turn is D F D^-1. The division of S^-1 = adjugate / determinant comes last, in parallel with the turn.
#pragma once
#include <cmath>

#include "steps.hpp"

namespace mpucal {
namespace {  // each instruction set has its own copy

// m and M before the measurement of four steps, one to a lane; g / |s| after it, over the determinant
struct Predicted {
  Lane m[3], M[6], stretch;
};

class Recursion {
 public:
  explicit Recursion(const Model& model) : D_(model.p.D), gravity_(model.constants.gravity) {
    for (int a = 0; a < 3; ++a) m_[a] = gravity_ * dot(D_[a], model.p.u);
  }

  double V() const { return V_; }
  double squares() const { return squares_; }

  // The next `count` steps; the flat mean, which begins them, is not among the squares
  template <bool kept>
  MPUCAL_APART void run(const Steps* steps, int count, bool flat, Predicted* predicted) {
    double m[3] = {m_[0], m_[1], m_[2]}, M[6] = {M_[0], M_[1], M_[2], M_[3], M_[4], M_[5]};
    double flat_square = 0.0, squares = 0.0, determinants = 1.0;
    for (int i = 0; i < count; ++i) {
      const Steps& four = steps[i / 4];
      const int t = i % 4;
      if constexpr (kept) {
        for (int a = 0; a < 3; ++a) put(predicted[i / 4].m[a], t, m[a]);
        for (int k = 0; k < 6; ++k) put(predicted[i / 4].M[k], t, M[k]);
      }
      double e[3], adjugate_e[3];
      for (int a = 0; a < 3; ++a) {
        e[a] = at(four.y[a], t) - m[a];
        M[kSym[a][a]] += at(four.R[a], t);
      }
      const Adjugate<double> adjugate(M);
      const double reciprocal = 1.0 / adjugate.determinant;
      multiply(adjugate.m, e, adjugate_e);
      const double square = dot(e, adjugate_e) * reciprocal;
      gather(determinants, adjugate.determinant, V_);
      squares += square;
      if (flat && i == 0) flat_square = square;
      const double stretch = follow(four, t, adjugate, adjugate_e, reciprocal, m, M);
      if constexpr (kept) put(predicted[i / 4].stretch, t, stretch);
    }
    V_ += 0.5 * (squares + std::log(determinants));
    squares_ += squares - flat_square;
    for (int a = 0; a < 3; ++a) m_[a] = m[a];
    for (int k = 0; k < 6; ++k) M_[k] = M[k];
  }

 private:
  // Update and turn. x is F s times the determinant; its length, which a turn keeps, scales s to g
  // and, as Q = [s]x diag(c) [s]x', also Q.
  MPUCAL_INLINE double follow(const Steps& four, int t, const Adjugate<double>& adjugate, const double (&adjugate_e)[3],
                            double reciprocal, double (&m)[3], double (&M)[6]) const {
    double x[3], GR[3][3], GR_S[3][3], spent[6], Q[6];
    for (int a = 0; a < 3; ++a) {
      x[a] = adjugate.determinant * at(four.H_y[a], t);
      for (int b = 0; b < 3; ++b) x[a] = nmadd(at(four.H_R[a][b], t), adjugate_e[b], x[a]);
    }
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) GR[a][b] = at(four.G_R[a][b], t);
    multiply(GR, adjugate.m, GR_S);
    multiply_to_symmetric(GR_S, GR, spent);
    process_noise(four, t, x, Q);
    const double stretch2 = gravity_ * gravity_ / dot(x, x), stretch = std::sqrt(stretch2);
    for (int k = 0; k < 6; ++k) M[k] = madd(stretch2, Q[k], nmadd(reciprocal, spent[k], at(four.G_R_G[k], t)));
    for (int a = 0; a < 3; ++a) m[a] = stretch * dot(D_[a], x);
    return stretch;
  }

  // D [x]x diag(c) [x]x' D'
  MPUCAL_INLINE void process_noise(const Steps& four, int t, const double (&x)[3], double (&Q)[6]) const {
    double W[3][3], W_c[3][3];
    for (int a = 0; a < 3; ++a) {
      W[a][0] = nmadd(D_[a][2], x[1], D_[a][1] * x[2]);
      W[a][1] = nmadd(D_[a][0], x[2], D_[a][2] * x[0]);
      W[a][2] = nmadd(D_[a][1], x[0], D_[a][0] * x[1]);
      for (int b = 0; b < 3; ++b) W_c[a][b] = W[a][b] * at(four.c[b], t);
    }
    multiply_to_symmetric(W_c, W, Q);
  }

  const double (&D_)[3][3];
  const double gravity_;
  double m_[3], M_[6] = {0, 0, 0, 0, 0, 0};
  double V_ = 0.0, squares_ = 0.0;
};

}  // namespace
}  // namespace mpucal
