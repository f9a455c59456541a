// Four consecutive steps of the hand's filter, one to a lane: everything that does not depend on x and P.
//
// Step k is measurement k, as in steps.hpp, then the turn and the travel that lead to the next. The state is held in the
// first body frame, where a turn does nothing: only the measurement knows the turn C since then.
#pragma once
#include "chain.hpp"
#include "hand.hpp"
#include "steps.hpp"

namespace mpucal {
namespace {  // each build of the filters keeps its own

constexpr double kLongestStep = 0.2;  // s: over a gap the hand's travel is as good as forgotten

struct HandSteps : Given {
  Lane omega[3], L[3][3], L_r[3];   // rate and lever arm's matrix at the measurement
  Lane C[3][3], C_next[3][3];       // the turn at the measurement, and after the step's
  Lane Hs[3][3], Ha[3][3];          // what s and a add to the measurement: D E C and D C
  Chain chain;
  Lane column[4][3], noise[4][3];   // [step][k] of Phi, in the places of p, v, a; of jerk Q
  Lane c_first[6];                  // C_next' diag(c) C_next
  Lane reset;                       // of the next sample

  // C is the first measurement's, and becomes that of the measurement after these
  MPUCAL_APART void read(const HandParameters& p, const HandSeries& series, const HandConstants& constants, long k,
                         double (&C_at)[3][3]) {
    Given::read(p, series, constants, k);
    turn_on(C_at);
    read_hand(p, series, k);
    observe(p);
    travel(series, constants, k);
  }

 private:
  MPUCAL_INLINE void turn_on(double (&C_at)[3][3]) {
    for (int t = 0; t < 4; ++t) {
      double F[3][3], turned[3][3];
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) F[a][b] = at(turn.F[a][b], t);
      multiply(F, C_at, turned);
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) {
          put(C[a][b], t, C_at[a][b]);
          put(C_next[a][b], t, turned[a][b]);
          C_at[a][b] = turned[a][b];
        }
    }
    for (int m = 0; m < 6; ++m) {
      const int a = kRow[m], b = kCol[m];
      const Lane first = C_next[0][a] * C_next[0][b] * c[0];
      c_first[m] = madd(C_next[2][a] * C_next[2][b], c[2], madd(C_next[1][a] * C_next[1][b], c[1], first));
    }
  }

  MPUCAL_INLINE void read_hand(const HandParameters& p, const HandSeries& series, long k) {
    const FourSamples samples(k - 1, static_cast<long>(series.n));
    Lane alpha[3], r_extra = samples.read(series.r_extra, 0.0);
    for (int a = 0; a < 3; ++a) omega[a] = alpha[a] = all(0.0);
    if (series.rate) {
      samples.read(series.rate, omega);
      samples.read(series.alpha, alpha);
    }
    if (k == 0) {
      put(r_extra, 0, 0.0);
      for (int a = 0; a < 3; ++a) put(omega[a], 0, 0.0), put(alpha[a], 0, 0.0);
    }
    const Lane omega2 = dot(omega, omega);
    for (int i = 0; i < 3; ++i) {
      R[i] = R[i] + r_extra;
      for (int j = 0; j < 3; ++j) L[i][j] = i == j ? omega[i] * omega[j] - omega2 : omega[i] * omega[j];
    }
    add_cross(L, all(1.0), alpha);
    multiply(L, p.r, L_r);
    for (int a = 0; a < 3; ++a) y[a] = y[a] - dot(p.D[a], L_r);
  }

  MPUCAL_INLINE void observe(const HandParameters& p) {
    Lane DE[3][3];
    for (int j = 0; j < 3; ++j) {
      const double* d = p.D[j];
      DE[j][0] = madd(p.tau, nmadd(d[2], omega[1], d[1] * omega[2]), d[0]);
      DE[j][1] = madd(p.tau, nmadd(d[0], omega[2], d[2] * omega[0]), d[1]);
      DE[j][2] = madd(p.tau, nmadd(d[1], omega[0], d[0] * omega[1]), d[2]);
    }
    multiply(DE, C, Hs);
    multiply(p.D, C, Ha);
  }

  MPUCAL_INLINE void travel(const HandSeries& series, const HandConstants& constants, long k) {
    const FourSamples samples(k, static_cast<long>(series.n));
    Lane h = dt;
    for (int i = 0; i < 4; ++i) put(h, i, std::min(at(dt, i), kLongestStep));
    chain.compute(h, constants.lam);
    const Lane jerk = samples.read(series.jerk, 0.0), zero = all(0.0);
    reset = samples.read(series.reset, -1.0);
    const auto& Phi = chain.Phi;
    for (int i = 0; i < 3; ++i) {
      transpose(zero, Phi[0][i], Phi[1][i], Phi[2][i], column[0][i], column[1][i], column[2][i], column[3][i]);
      transpose(zero, jerk * chain.Q[kSym[i][0]], jerk * chain.Q[kSym[i][1]], jerk * chain.Q[kSym[i][2]], noise[0][i],
                noise[1][i], noise[2][i], noise[3][i]);
    }
  }
};

}  // namespace
}  // namespace mpucal
