// The gravity filter and its exact derivatives: plain arrays in, plain numbers out.
//
// One step, with s the gravity vector in the body frame (m/s^2), P its covariance:
//   e = y - D s - b_a,  S = D P D' + R,  R = diag(r_scale Sigma_a)
//   s <- g (s + K e) / |s + K e|,  P <- P - K D P,  K = P D' S^-1
//   s <- F s,  P <- F P F' + [s]x diag(c) [s]x',  F = exp(-dt [Gyro (omega_bar - b_omega)]x)
// and V = sum of 1/2 (e' S^-1 e + log det S), the paper's equation (8).
//
// Derivatives run forward, four parameters to a lane group. A parameter's lane is given by `Lanes`, which the
// table of calibration/parameters.py makes: row j of D and b_a[j] share lane group j, so that their partial derivatives
// are products of one vector with scalars; the gyroscope's parameters are in the order of `eta` in coefficients.hpp.
#pragma once
#include <cstddef>

#include "parameters.hpp"

namespace mpucal {

static_assert(Lanes::D == 0 && Lanes::b_a == 3);
static_assert(Lanes::b_omega % 4 == 0 && Lanes::K % 4 == 1);

// Number of groups of four for this many lanes
constexpr int groups_of(int lanes) { return (lanes + 3) / 4; }

// Input series of the filter, (n,) or (n, 3) row by row; a null pointer means the value in brackets.
struct Series {
  std::size_t n;
  const double* y;        // m/s^2
  const double* omega;    // rad/s, mean rate over the step that leads to the sample
  const double* dt;       // s, length of that step
  const double* r_scale;  // factor of Sigma_a [1]
  const double* q_scale;  // factor of Sigma_omega [1]
  const double* q_extra;  // rad^2 added to the step's angle variance on each axis [0]
};

struct Constants {
  double gravity;
  double Sigma_a[3], Sigma_omega[3];
  double flat_y[3], flat_n;  // the first measurement: the flat segment's mean, with covariance Sigma_a / flat_n
};

// Samples up to which sums are wanted: ascending, the last one n; each holds for the next whole block of steps.
struct Ends {
  const long* at;
  int count;
};

// Output; gradient and fisher are not written for the value alone.
struct Result {
  double V;
  double squares;         // sum of e' S^-1 e over the n samples
  Ends ends;
  double* gradient;       // (ends, lanes), filled up to whole groups: of the samples before each end
  double* fisher;         // (ends, lanes, lanes), as the gradient
};

// lanes: 0 (value only) or those of a model
using Evaluate = void (*)(const Parameters&, const Series&, const Constants&, int lanes, Result&);

void evaluate_portable(const Parameters&, const Series&, const Constants&, int lanes, Result&);
#ifdef MPUCAL_AVX2
void evaluate_avx2(const Parameters&, const Series&, const Constants&, int lanes, Result&);
#endif

// Sums of the linear initialiser: C_t turns the first body frame into the frame at t (b_omega removed, no K).
struct Moments {
  double CC[9][9], yC[3][9], C[9], y[3], yy, n;
};
void moments(const Series&, const double b_omega[3], Moments&);

}  // namespace mpucal
