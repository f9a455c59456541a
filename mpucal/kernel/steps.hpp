// Four consecutive steps of the series, one to a lane: everything that does not depend on s and P.
//
// Step k is measurement k (the flat segment's mean for k = 0, then sample k - 1) and the turn that leads to the next.
#pragma once
#include <algorithm>

#include "filter.hpp"
#include "rotation.hpp"

namespace mpucal {
namespace {  // each instruction set has its own copy

// Reads one quantity of four consecutive samples; beyond an end of the series, its first or last sample is repeated.
class FourSamples {
 public:
  MPUCAL_INLINE FourSamples(long first, long n) {
    for (long i = 0; i < 4; ++i) at_[i] = std::max(0L, std::min(first + i, n - 1));
  }
  MPUCAL_INLINE Lane read(const double* p) const { return Lane{p[at_[0]], p[at_[1]], p[at_[2]], p[at_[3]]}; }
  MPUCAL_INLINE Lane read(const double* p, double absent) const { return p ? read(p) : all(absent); }
  MPUCAL_INLINE void read(const double* p, Lane (&out)[3]) const {
    for (int a = 0; a < 3; ++a)
      out[a] = Lane{p[3 * at_[0] + a], p[3 * at_[1] + a], p[3 * at_[2] + a], p[3 * at_[3] + a]};
  }

 private:
  long at_[4];
};

// Constants over the steps; the inverse of D transforms the recursion to the accelerometer's axes.
struct Model {
  const Parameters& p;
  const Constants& constants;
  double D_inverse[3][3];

  Model(const Parameters& parameters, const Constants& given) : p(parameters), constants(given) {
    const double (&D)[3][3] = p.D;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const int a = (j + 1) % 3, b = (j + 2) % 3, c = (i + 1) % 3, d = (i + 2) % 3;
        D_inverse[i][j] = D[a][c] * D[b][d] - D[a][d] * D[b][c];
      }
    const double determinant = D[0][0] * D_inverse[0][0] + D[0][1] * D_inverse[1][0] + D[0][2] * D_inverse[2][0];
    for (auto& row : D_inverse)
      for (double& x : row) x /= determinant;
  }
};

// Values of the series for both filters
struct Given {
  Lane y[3];  // y - b_a
  Lane R[3];  // diagonal of R
  Turn<Lane> turn;
  Lane rate[3], dt;  // turn.phi = -dt Gyro rate
  Lane c[3];         // variance of the step's angle

  MPUCAL_INLINE void read(const Parameters& p, const Series& series, const Constants& constants, long k) {
    read_measurements(p, series, constants, k);
    read_turns(p, series, constants, k);
  }

 private:
  MPUCAL_INLINE void read_measurements(const Parameters& p, const Series& series, const Constants& constants, long k) {
    const FourSamples samples(k - 1, static_cast<long>(series.n));
    samples.read(series.y, y);
    Lane r_scale = samples.read(series.r_scale, 1.0);
    if (k == 0) {
      for (int a = 0; a < 3; ++a) put(y[a], 0, constants.flat_y[a]);
      put(r_scale, 0, 1.0 / constants.flat_n);
    }
    for (int a = 0; a < 3; ++a) {
      y[a] = y[a] - all(p.b_a[a]);
      R[a] = constants.Sigma_a[a] * r_scale;
    }
  }

  MPUCAL_INLINE void read_turns(const Parameters& p, const Series& series, const Constants& constants, long k) {
    const FourSamples samples(k, static_cast<long>(series.n));
    dt = samples.read(series.dt);
    samples.read(series.omega, rate);
    for (int a = 0; a < 3; ++a) rate[a] = rate[a] - all(p.b_omega[a]);
    for (int a = 0; a < 3; ++a) turn.phi[a] = -1.0 * dt * dot(p.K[a], rate);
    turn.compute();
    const Lane q_scale = dt * dt * samples.read(series.q_scale, 1.0), q_extra = samples.read(series.q_extra, 0.0);
    for (int a = 0; a < 3; ++a) c[a] = madd(q_scale, constants.Sigma_omega[a], q_extra);
  }
};

struct Steps : Given {
  // H = F D^-1 and G = D F D^-1, with the values of the measurement
  Lane H_y[3], H_R[3][3], G_R[3][3], G_R_G[6];

  MPUCAL_APART void read(const Model& model, const Series& series, long k) {
    Given::read(model.p, series, model.constants, k);
    combine(model);
  }

 private:
  MPUCAL_INLINE void combine(const Model& model) {
    Lane H[3][3], G[3][3];
    multiply(turn.F, model.D_inverse, H);
    multiply(model.p.D, H, G);
    multiply(H, y, H_y);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) {
        H_R[a][b] = H[a][b] * R[b];
        G_R[a][b] = G[a][b] * R[b];
      }
    multiply_to_symmetric(G_R, G, G_R_G);
  }
};

}  // namespace
}  // namespace mpucal
