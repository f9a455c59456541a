// One step of position, velocity and acceleration under d^3p/dt^3 = -3 lam a - 3 lam^2 v - lam^3 p + white noise.
#pragma once
#include <cmath>

#include "lane.hpp"

namespace mpucal {
namespace {  // each build of the filters keeps its own

// exp(-z), and the sum of (2 z)^n / (5 6 ... (5 + n)) for n = 0, 1 ...: all that is transcendental in a step
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

// sum of c_n x^n; remainders below 1e-17 for |x| < 1
MPUCAL_INLINE Lane series(const Factorials& f, const Lane& x) {
  Lane sum = all(f.c[f.count - 1]);
  for (int n = f.count - 2; n >= 0; --n) sum = madd(x, sum, f.c[n]);
  return sum;
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

// Three equal poles at -lam keep the position bounded. Phi = exp(A h); Q is the integral of g g', g(t) the response
// of (p, v, a) to an impulse of jerk, for unit spectral density. Four steps, one to a lane.
struct Chain {
  Lane Phi[3][3], Q[6];

  MPUCAL_INLINE void compute(const Lane& h, double lam) {
    const Decay of_step = decay_of(lam * h);
    transition(h, lam, of_step.decay);
    noise(h, lam, of_step.decay * of_step.decay, of_step.sum);
  }

 private:
  // N = A + lam I has N^3 = 0 and N^2 = left right'
  MPUCAL_INLINE void transition(const Lane& h, double lam, const Lane& decay) {
    const double l2 = lam * lam, l3 = lam * l2;
    const double N[3][3] = {{lam, 1, 0}, {0, lam, 1}, {-l3, -3 * l2, -2 * lam}};
    const double left[3] = {1, -lam, l2}, right[3] = {l2, 2 * lam, 1};
    const Lane first = decay * h, second = 0.5 * first * h;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        Phi[i][j] = madd(first, N[i][j], left[i] * right[j] * second);
        if (i == j) Phi[i][j] = Phi[i][j] + decay;
      }
  }

  // p = t^2/2, v = t - lam t^2/2, a = 1 - 2 lam t + lam^2 t^2/2, all times exp(-lam t)
  MPUCAL_INLINE void noise(const Lane& h, double lam, const Lane& decay2, const Lane& sum) {
    Lane ends[5], I[5];  // of t^m exp(-2 lam t) from 0 to h: the last by its series, downward without cancellation
    ends[1] = h * decay2;
    for (int m = 2; m < 5; ++m) ends[m] = h * ends[m - 1];
    I[4] = h * ends[4] * sum;
    for (int m = 4; m > 0; --m) I[m - 1] = (1.0 / m) * madd(2.0 * lam, I[m], ends[m]);
    const double l2 = lam * lam, l3 = lam * l2, l4 = l2 * l2;
    Q[0] = 0.25 * I[4];
    Q[1] = nmadd(0.25 * lam, I[4], 0.5 * I[3]);
    Q[2] = madd(0.25 * l2, I[4], nmadd(lam, I[3], 0.5 * I[2]));
    Q[3] = madd(0.25 * l2, I[4], nmadd(lam, I[3], I[2]));
    Q[4] = nmadd(0.25 * l3, I[4], madd(1.5 * l2, I[3], nmadd(2.5 * lam, I[2], I[1])));
    Q[5] = madd(0.25 * l4, I[4], nmadd(2.0 * l3, I[3], madd(5.0 * l2, I[2], nmadd(4.0 * lam, I[1], I[0]))));
  }
};

}  // namespace
}  // namespace mpucal
