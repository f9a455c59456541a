// Sums for the linear initialiser.
#include <cstring>

#include "filter.hpp"
#include "rotation.hpp"

namespace mpucal {

void moments(const Series& series, const double b_omega[3], Moments& out) {
  std::memset(&out, 0, sizeof out);
  double C[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (std::size_t i = 0; i < series.n; ++i) {
    Turn<double> turn;
    double next[3][3];
    for (int a = 0; a < 3; ++a) turn.phi[a] = -series.dt[i] * (series.omega[3 * i + a] - b_omega[a]);
    turn.compute();
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        next[a][b] = turn.F[a][0] * C[0][b] + turn.F[a][1] * C[1][b] + turn.F[a][2] * C[2][b];
    std::memcpy(C, next, sizeof C);
    const double weight = series.r_scale ? 1.0 / series.r_scale[i] : 1.0, *flat = &C[0][0], *y = series.y + 3 * i;
    for (int a = 0; a < 9; ++a) {
      const double x = weight * flat[a];
      out.C[a] += x;
      for (int b = a; b < 9; ++b) out.CC[a][b] += x * flat[b];
      for (int j = 0; j < 3; ++j) out.yC[j][a] += y[j] * x;
    }
    for (int j = 0; j < 3; ++j) out.y[j] += weight * y[j];
    out.yy += weight * (y[0] * y[0] + y[1] * y[1] + y[2] * y[2]);
    out.n += weight;
  }
  for (int a = 0; a < 9; ++a)
    for (int b = 0; b < a; ++b) out.CC[a][b] = out.CC[b][a];
}

}  // namespace mpucal
