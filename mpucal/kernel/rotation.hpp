// exp([phi]x) and its left Jacobian. Steps are small, so short series serve; large ones take the closed form.
#pragma once
#include <cmath>

namespace mpucal {
namespace {  // each build of the filter keeps its own

struct Turn {
  double phi[3], F[3][3];
  double a, b, c;  // sin x / x, (1 - cos x) / x^2, (x - sin x) / x^3

  explicit Turn(const double (&vector)[3]) : phi{vector[0], vector[1], vector[2]} {
    const double x2 = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2];
    if (x2 < 0.0625) {
      // remainders below 1e-17 for x < 1/4
      a = 1.0 + x2 * (-1.0 / 6 + x2 * (1.0 / 120 + x2 * (-1.0 / 5040 + x2 * (1.0 / 362880 - x2 / 39916800))));
      b = 0.5 + x2 * (-1.0 / 24 + x2 * (1.0 / 720 + x2 * (-1.0 / 40320 + x2 * (1.0 / 3628800 - x2 / 479001600))));
      c = 1.0 / 6 + x2 * (-1.0 / 120 + x2 * (1.0 / 5040 + x2 * (-1.0 / 362880 + x2 / 39916800)));
    } else {
      const double x = std::sqrt(x2), half = std::sin(0.5 * x);
      a = std::sin(x) / x;
      b = 2.0 * half * half / x2;
      c = (1.0 - a) / x2;
    }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) F[i][j] = b * phi[i] * phi[j] + (i == j ? 1.0 - b * x2 : 0.0);
    add_cross(F, a);
  }

  void left_jacobian(double (&J)[3][3]) const {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) J[i][j] = c * phi[i] * phi[j] + (i == j ? a : 0.0);
    add_cross(J, b);
  }

 private:
  void add_cross(double (&M)[3][3], double factor) const {
    M[0][1] -= factor * phi[2], M[1][0] += factor * phi[2];
    M[0][2] += factor * phi[1], M[2][0] -= factor * phi[1];
    M[1][2] -= factor * phi[0], M[2][1] += factor * phi[0];
  }
};

}  // namespace
}  // namespace mpucal
