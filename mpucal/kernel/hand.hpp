// Filter for a sensor that a hand moves: gravity and the hand's bounded travel. Arrays in, numbers out.
//
// The state is four vectors in the body frame, s gravity (|s| = g), p, v, a the hand's travel, speed and
// acceleration, as the accelerometer reads it; x = (s, p, v, a), P its covariance:
//   e = y - D (E s + L r) - a - b_a,  E = I + tau [omega]x,  L = [alpha]x + [omega]x^2,  S = H P H' + R
//   x <- x + K e,  s <- g s / |s|,  P <- P - K H P,  K = P H' (H P H' + R / w)^-1
//   x <- F x,  F = exp(-dt [Gyro (omega_bar - b_omega)]x),  then (p, v, a) by the chain of chain.hpp
// and V = sum of rho(e' S^-1 e) + 1/2 log det S; rho is Huber's, or redescends, and w is its weight.
//
// The derivatives hold the gains and weights: gradient = sum of w de' S^-1 e, Fisher matrix = sum of w de' S^-1 de. The
// gradient's expectation is zero at the truth, since de depends on the past alone, but it is not that of V. Where the
// series has forces, a group for each column of S, the gyroscope's sensitivity to them, follows those of theta.
#pragma once
#include "filter.hpp"

namespace mpucal {

static_assert(Lanes::r % 4 == 0);

constexpr int kHandGroups = groups_of(LanesUsed::hand), kGroupsOfS = 3;

struct HandSeries : Series {
  const double* rate;     // rad/s at the sample, bias removed, for lever arm and delay [neither]
  const double* alpha;    // rad/s^2 at the sample
  const double* r_extra;  // (m/s^2)^2 added to R on each axis [0]
  const double* jerk;     // (m/s^3)^2/Hz, the chain's noise [0]
  const double* reset;    // m/s^2: the travel of a long rest with this standard deviation of a; below zero: no reset [none]
  const double* force;    // m/s^2 over the step that leads to the sample: omega is less by S force, S = 0 [no S]
};

struct HandConstants : Constants {
  double huber;  // threshold on |L^-1 e|; infinity for the plain square
  double tail;   // beyond it: 0 Huber's rho, 1 redescending
  double lam;    // 1/s, the chain's poles
};

// Output; where the pointers are not null, sums of the derivatives, and the course of the samples.
struct HandResult : Result {
  double* innovation;  // (n, 3) whitened, L^-1 e
  double* gravity;     // (n, 3) s before the update
};

using EvaluateHand = void (*)(const HandParameters&, const HandSeries&, const HandConstants&, HandResult&);

void evaluate_hand_portable(const HandParameters&, const HandSeries&, const HandConstants&, HandResult&);
#ifdef MPUCAL_AVX2
void evaluate_hand_avx2(const HandParameters&, const HandSeries&, const HandConstants&, HandResult&);
#endif

}  // namespace mpucal
