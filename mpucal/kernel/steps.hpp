// Four consecutive steps as the series give them, one to a lane: everything that does not depend on s and P.
//
// Step k is measurement k (the flat segment's mean for k = 0, then sample k - 1) and the turn that leads to the next.
#pragma once
#include <algorithm>

#include "filter.hpp"
#include "rotation.hpp"

namespace mpucal {
namespace {  // each build of the filter keeps its own

// Reads what four samples in a row say of one quantity; beside the series' ends, its first or last sample again.
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

struct Steps {
  Lane y[3];     // y - D L r - b_a: what D s is to explain
  Lane R[3];     // diagonal of R
  Lane noise;    // its derivative by sigma_h
  Lane L[3][3];  // the lever arm's matrix
  Lane L_r[3];   // L r
  Turn<Lane> turn;
  Lane rate[3], dt;  // turn.phi = -dt Gyro rate
  Lane c[3];         // variance of the angle turned through

  MPUCAL_APART void read(const Parameters& p, const Series& series, const Constants& constants, long k) {
    read_measurements(p, series, constants, k);
    read_turns(p, series, constants, k);
  }

 private:
  MPUCAL_INLINE void read_measurements(const Parameters& p, const Series& series, const Constants& constants, long k) {
    const FourSamples samples(k - 1, static_cast<long>(series.n));
    samples.read(series.y, y);
    Lane r_scale = samples.read(series.r_scale, 1.0), motion = samples.read(series.motion, 0.0);
    for (int a = 0; a < 3; ++a) {
      L[a][0] = L[a][1] = L[a][2] = all(0.0);
    }
    if (series.rate) {
      Lane omega[3], alpha[3];
      samples.read(series.rate, omega);
      samples.read(series.alpha, alpha);
      lever(omega, alpha);
    }
    if (k == 0) {
      for (int a = 0; a < 3; ++a) {
        put(y[a], 0, constants.flat_y[a]);
        for (int b = 0; b < 3; ++b) put(L[a][b], 0, 0.0);
      }
      put(r_scale, 0, 1.0 / constants.flat_n);
      put(motion, 0, 0.0);
    }
    noise = 2.0 * p.sigma_h * motion;
    multiply(L, p.r, L_r);
    for (int a = 0; a < 3; ++a) {
      y[a] = y[a] - dot(p.D[a], L_r) - all(p.b_a[a]);
      R[a] = madd(r_scale, constants.Sigma_a[a], p.sigma_h * p.sigma_h * motion);
    }
  }

  // [alpha]x + [omega]x^2
  MPUCAL_INLINE void lever(const Lane (&omega)[3], const Lane (&alpha)[3]) {
    const Lane omega2 = dot(omega, omega);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) L[i][j] = i == j ? omega[i] * omega[j] - omega2 : omega[i] * omega[j];
    add_cross(L, all(1.0), alpha);
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

}  // namespace
}  // namespace mpucal
