// One step of position, velocity and acceleration under d^3p/dt^3 = -3 lam a - 3 lam^2 v - lam^3 p + white noise.
//
// The state is a, b = -2 lam a - 3 lam^2 v - lam^3 p and c = lam^2 a + 2 lam^3 v + lam^4 p. Without noise
// a' = -lam a + b, b' = -lam b + c and c' = -lam c: the matrix of a step is triangular, and a, which is measured, is a
// component of the state.
#pragma once
#include <cmath>

#include "lane.hpp"

namespace mpucal {
namespace {  // each instruction set has its own copy

// exp(-z), and the sum of (2 z)^n / (5 6 ... (5 + n)) for n = 0, 1 ...: the only transcendental functions of a step
struct Decay {
  Lane decay, sum;
};

// c_n = first / (begin ... (begin + n - 1))
struct Factorials {
  static constexpr int count = 18;
  double c[count] = {};
  constexpr Factorials(double first, int begin) {
    c[0] = first;
    for (int n = 1; n < count; ++n) c[n] = c[n - 1] / (begin + n - 1);
  }
};
constexpr Factorials kOfDecay(1.0, 1), kOfSum(0.2, 6);

// Sum of c_n x^n; remainders below 1e-17 for |x| < 1
MPUCAL_INLINE Lane series(const Factorials& f, const Lane& x) {
  const Lane x2 = x * x;
  Lane even = all(f.c[f.count - 2]), odd = all(f.c[f.count - 1]);  // powers in two independent chains
  for (int n = f.count - 4; n >= 0; n -= 2) even = madd(x2, even, f.c[n]), odd = madd(x2, odd, f.c[n + 1]);
  return madd(x, odd, even);
}

constexpr double kShortStep = 0.5;

MPUCAL_APART inline Decay any_decay(const Lane& z) {
  Decay lanes;
  for (int i = 0; i < 4; ++i) {
    const double x = 2.0 * at(z, i);
    double term = 0.2, sum = term;
    for (int n = 6; term > 1e-17 * sum; ++n) sum += term *= x / n;
    put(lanes.decay, i, std::exp(-at(z, i)));
    put(lanes.sum, i, sum);
  }
  return lanes;
}

MPUCAL_INLINE Decay decay_of(const Lane& z) {
  for (int i = 0; i < 4; ++i)
    if (!(at(z, i) < kShortStep)) return any_decay(z);
  return {series(kOfDecay, -1.0 * z), series(kOfSum, 2.0 * z)};
}

// Three equal poles at -lam keep the position bounded. Phi holds the first row of the triangle exp(A h), whose diagonals
// are constant; Q is the integral of g g', g(t) the response of (a, b, c) to an impulse of jerk, for unit spectral
// density. Four steps, one to a lane.
struct Chain {
  Lane Phi[3], Q[6];

  MPUCAL_INLINE void compute(const Lane& h, double lam) {
    const Decay of_step = decay_of(lam * h);
    Phi[0] = of_step.decay;
    Phi[1] = h * Phi[0];
    Phi[2] = 0.5 * h * Phi[1];
    noise(h, lam, of_step.decay * of_step.decay, of_step.sum);
  }

  // The covariance of (0, a, b, c) after a long rest, where a has this standard deviation: Q of an endless step
  static void rest(double lam, double sd_a, Lane (&P)[4]) {
    const double aa = sd_a * sd_a, l2 = lam * lam;
    const double ab = -5.0 / 3.0 * lam * aa, ac = 2.0 / 3.0 * l2 * aa, bc = -4.0 * l2 * lam * aa;
    P[0] = all(0.0);
    P[1] = Lane{0.0, aa, ab, ac};
    P[2] = Lane{0.0, ab, 20.0 / 3.0 * l2 * aa, bc};
    P[3] = Lane{0.0, ac, bc, 8.0 / 3.0 * l2 * l2 * aa};
  }

 private:
  // a = 1 - 2 lam t + lam^2 t^2/2, b = -2 lam + lam^2 t, c = lam^2, all times exp(-lam t)
  MPUCAL_INLINE void noise(const Lane& h, double lam, const Lane& decay2, const Lane& sum) {
    Lane ends[5], I[5];  // of t^m exp(-2 lam t) from 0 to h: the last by its series, downward without cancellation
    ends[1] = h * decay2;
    for (int m = 2; m < 5; ++m) ends[m] = h * ends[m - 1];
    I[4] = h * ends[4] * sum;
    for (int m = 4; m > 0; --m) I[m - 1] = (1.0 / m) * madd(2.0 * lam, I[m], ends[m]);
    const double l2 = lam * lam, l3 = lam * l2, l4 = l2 * l2;
    Q[0] = madd(0.25 * l4, I[4], nmadd(2.0 * l3, I[3], madd(5.0 * l2, I[2], nmadd(4.0 * lam, I[1], I[0]))));
    Q[1] = madd(0.5 * l4, I[3], nmadd(3.0 * l3, I[2], nmadd(2.0 * lam, I[0], 5.0 * l2 * I[1])));
    Q[2] = madd(0.5 * l4, I[2], nmadd(2.0 * l3, I[1], l2 * I[0]));
    Q[3] = madd(l4, I[2], nmadd(4.0 * l3, I[1], 4.0 * l2 * I[0]));
    Q[4] = nmadd(2.0 * l3, I[0], l4 * I[1]);
    Q[5] = l4 * I[0];
  }
};

}  // namespace
}  // namespace mpucal
