// One step of position, velocity and acceleration under d^3p/dt^3 = -3 lam a - 3 lam^2 v - lam^3 p + white noise.
#pragma once
#include <cmath>

namespace mpucal {
namespace {  // each build of the filters keeps its own

// Three equal poles at -lam keep the position bounded. Phi = exp(A h); Q is the integral of g g', g(t) the response
// of (p, v, a) to an impulse of jerk, for unit spectral density.
struct Chain {
  double h = 0.0, Phi[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, Q[3][3] = {};

  void advance(double step, double lam) {
    if (step == h) return;
    h = step;
    const double decay = std::exp(-lam * h), half = 0.5 * h * h, l2 = lam * lam, l3 = lam * l2;
    // N = A + lam I has N^3 = 0 and N^2 = left right'
    const double N[3][3] = {{lam, 1, 0}, {0, lam, 1}, {-l3, -3 * l2, -2 * lam}};
    const double left[3] = {1, -lam, l2}, right[3] = {l2, 2 * lam, 1};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) Phi[i][j] = decay * ((i == j ? 1.0 : 0.0) + h * N[i][j] + half * left[i] * right[j]);
    noise(decay * decay, lam);
  }

 private:
  // p = t^2/2, v = t - lam t^2/2, a = 1 - 2 lam t + lam^2 t^2/2, all times exp(-lam t)
  void noise(double decay2, double lam) {
    double I[5];  // of t^m exp(-2 lam t) from 0 to h: a series of positive terms, then downward without cancellation
    const double x = 2.0 * lam * h;
    double term = 0.2, sum = term;
    for (int n = 6; term > 1e-17 * sum; ++n) sum += term *= x / n;
    const double h2 = h * h, ends[5] = {0.0, h * decay2, h2 * decay2, h2 * h * decay2, h2 * h2 * decay2};
    I[4] = h * ends[4] * sum;
    for (int m = 4; m > 0; --m) I[m - 1] = (ends[m] + 2.0 * lam * I[m]) / m;
    const double l2 = lam * lam, l3 = lam * l2, l4 = l2 * l2;
    Q[0][0] = 0.25 * I[4];
    Q[0][1] = Q[1][0] = 0.5 * I[3] - 0.25 * lam * I[4];
    Q[0][2] = Q[2][0] = 0.5 * I[2] - lam * I[3] + 0.25 * l2 * I[4];
    Q[1][1] = I[2] - lam * I[3] + 0.25 * l2 * I[4];
    Q[1][2] = Q[2][1] = I[1] - 2.5 * lam * I[2] + 1.5 * l2 * I[3] - 0.25 * l3 * I[4];
    Q[2][2] = I[0] - 4.0 * lam * I[1] + 5.0 * l2 * I[2] - 2.0 * l3 * I[3] + 0.25 * l4 * I[4];
  }
};

}  // namespace
}  // namespace mpucal
