// Four consecutive steps of the hand's filter, one to a lane: everything that does not depend on x and P.
//
// Step k is measurement k, as in steps.hpp, then the turn and the travel that lead to the next. The state is held in the
// first body frame, where a turn has no effect: only the measurement depends on the turn C since then.
#pragma once
#include "chain.hpp"
#include "hand.hpp"
#include "steps.hpp"

namespace mpucal {
namespace {  // each instruction set has its own copy

constexpr double kLongestStep = 0.2;  // s: the hand's travel is practically forgotten over a gap

struct HandSteps : Given {
  Lane omega[3], L[3][3], L_r[3];   // rate and lever arm's matrix at the measurement
  Lane C[3][3], C_next[3][3];       // the turn at the measurement, and after the step's
  Lane Hs[3][3];                    // derivative of the measurement by s, D E C; that by a is C
  Chain chain;
  Lane column[4][3], noise[4][3];   // [step][k] of the triangle Phi, in the places of a, b, c; of jerk Q
  Lane c_first[6];                  // C_next' diag(c) C_next
  Lane reset;                       // of the next sample
  Lane force[kGroupsOfS];           // not read where there are none

  // On entry the rows of C belong to the first measurement, on return to the measurement after these.
  MPUCAL_APART void read(const HandParameters& p, const HandSeries& series, const HandConstants& constants, long k,
                         Lane (&rows)[3]) {
    Given::read(p, series, constants, k);
    turn_on(rows);
    read_hand(p, series, k);
    observe(p);
    travel(series, constants, k);
  }

 private:
  MPUCAL_INLINE void turn_on(Lane (&rows)[3]) {
    Lane at_step[5][3];
    for (int a = 0; a < 3; ++a) at_step[0][a] = rows[a];
    for (int t = 0; t < 4; ++t)
      for (int a = 0; a < 3; ++a)
        at_step[t + 1][a] = madd(at(turn.F[a][2], t), at_step[t][2],
                                 madd(at(turn.F[a][1], t), at_step[t][1], at(turn.F[a][0], t) * at_step[t][0]));
    for (int a = 0; a < 3; ++a) {
      Lane unused;
      transpose(at_step[0][a], at_step[1][a], at_step[2][a], at_step[3][a], C[a][0], C[a][1], C[a][2], unused);
      transpose(at_step[1][a], at_step[2][a], at_step[3][a], at_step[4][a], C_next[a][0], C_next[a][1], C_next[a][2],
                unused);
      rows[a] = at_step[4][a];
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
  }

  MPUCAL_INLINE void travel(const HandSeries& series, const HandConstants& constants, long k) {
    const FourSamples samples(k, static_cast<long>(series.n));
    Lane h = dt;
    for (int i = 0; i < 4; ++i) put(h, i, std::min(at(dt, i), kLongestStep));
    chain.compute(h, constants.lam);
    const Lane jerk = samples.read(series.jerk, 0.0), zero = all(0.0);
    reset = samples.read(series.reset, -1.0);
    if (series.force) samples.read(series.force, force);
    const auto& Phi = chain.Phi;
    for (int i = 0; i < 3; ++i) {
      transpose(zero, Phi[i], i > 0 ? Phi[i - 1] : zero, i > 1 ? Phi[i - 2] : zero, column[0][i], column[1][i],
                column[2][i], column[3][i]);
      transpose(zero, jerk * chain.Q[kSym[i][0]], jerk * chain.Q[kSym[i][1]], jerk * chain.Q[kSym[i][2]], noise[0][i],
                noise[1][i], noise[2][i], noise[3][i]);
    }
  }
};

}  // namespace
}  // namespace mpucal
