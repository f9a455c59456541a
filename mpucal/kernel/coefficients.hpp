// Coefficients of the derivatives, which are linear in them: functions of the recursion's s and P alone, shared by all
// parameters. They are computed for four steps at once; those that a group of parameters needs as a vector over the
// parameters are then transposed, [step][...].
#pragma once
#include "filter.hpp"
#include "recursion.hpp"

namespace mpucal {
namespace {  // each instruction set has its own copy

struct Coefficients {
  // the measurement, whitened by L^-1 =: V
  Lane white[3][3], T[3][3], residual[3];  // V, V D, V e
  Lane dV[6];                              // V(theta) by P: half of D'S^-1 D - z z', off-diagonals doubled
  Lane q[4], dV_dD[4][3];                  // s and 1; V(theta) by row j of D, by way of S
  Lane B[3];                               // rows of V A, A = D P; first step only
  // the update and the turn: W = I - K D, N the derivative of g x / |x|
  Lane FNW[3][3], FK[3][3], FNK[3][3];
  Lane carry[6][6];                          // (F W) P (F W)' as it is linear in P
  Lane v[3], z[3];                           // S^-1 e, D'v
  Lane q_plus[4], FP[4][3], FNP[4][3];       // s after the update and 1; F P+, F N P+
  Lane s[3];                                 // after the turn
  Lane PF_beside[3], PF_apart[3];            // P after the turn: yz, zx, xy; yy - zz, zz - xx, xx - yy
  Lane sc[3][3];                             // s_a c_b
  Lane eta_b[4][3], eta_K[4][3], eta_K2[4][3];  // of d(F x) = eta x (F x): for b_omega, K_xx to K_xz, K_yy to K_zz

  // The order lets the roots and the division of the whitening end while other values are computed.
  template <int G>
  MPUCAL_APART void compute(const Model& model, const Steps& steps, const Predicted& predicted) {
    Lane S[6], e[3], s_before[3], A[3][3], P[6], K[3][3], plus[3];
    for (int m = 0; m < 6; ++m) S[m] = predicted.M[m];
    for (int a = 0; a < 3; ++a) {
      e[a] = steps.y[a] - predicted.m[a];
      S[kSym[a][a]] = S[kSym[a][a]] + steps.R[a];
    }
    Adjugate<Lane> inverse(S);
    const Lane determinant = inverse.determinant, reciprocal = whitener(S, inverse, white);
    multiply(model.D_inverse, predicted.m, s_before);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) {
        const double (&row)[3] = model.D_inverse[b];
        A[a][b] = madd(row[2], predicted.M[kSym[a][2]],
                       madd(row[1], predicted.M[kSym[a][1]], row[0] * predicted.M[kSym[a][0]]));
      }
    for (int m = 0; m < 6; ++m) {
      const double (&row)[3] = model.D_inverse[kRow[m]];
      P[m] = madd(row[2], A[2][kCol[m]], madd(row[1], A[1][kCol[m]], row[0] * A[0][kCol[m]]));
    }
    for (Lane& m : inverse.m) m = reciprocal * m;
    update(model.p, inverse.m, e, s_before, A, K, plus);
    update_and_turn(model.p, model.constants, steps, P, K, plus, determinant * predicted.stretch);
    turn<G>(model.p, steps);
    whiten(model.p, e, A);
  }

 private:
  // The gain K = A' S^-1 and s after the update
  MPUCAL_INLINE void update(const Parameters& p, const Lane (&inverse)[6], const Lane (&e)[3],
                            const Lane (&s_before)[3], const Lane (&A)[3][3], Lane (&K)[3][3], Lane (&plus)[3]) {
    Lane A_v[3], by_D[3][3];
    multiply(inverse, e, v);
    multiply_transposed(p.D, v, z);
    multiply_transposed(A, v, A_v);
    for (int a = 0; a < 3; ++a) {
      plus[a] = s_before[a] + A_v[a];
      for (int j = 0; j < 3; ++j) {
        K[a][j] = madd(A[2][a], inverse[kSym[2][j]], madd(A[1][a], inverse[kSym[1][j]], A[0][a] * inverse[kSym[0][j]]));
        by_D[j][a] = nmadd(v[j], A_v[a], K[a][j]);
      }
    }
    turn_round(by_D, dV_dD);
    turn_round(s_before, 1.0, q);
    turn_round(plus, 1.0, q_plus);
  }

  // V(theta) and its coefficients
  MPUCAL_INLINE void whiten(const Parameters& p, const Lane (&e)[3], const Lane (&A)[3][3]) {
    multiply_lower(white, p.D, T);
    multiply_lower(white, e, residual);
    for (int m = 0; m < 6; ++m) {
      const int a = kRow[m], b = kCol[m];
      const Lane TT = madd(T[2][a], T[2][b], madd(T[1][a], T[1][b], T[0][a] * T[0][b]));
      dV[m] = (a == b ? 0.5 : 1.0) * nmadd(z[a], z[b], TT);
    }
    for (int a = 0; a < 3; ++a) {
      Lane first = all(0.0);
      for (int b = 0; b <= a; ++b)
        first = madd(at(white[a][b], 0), Lane{at(A[b][0], 0), at(A[b][1], 0), at(A[b][2], 0), 0.0}, first);
      B[a] = first;
    }
  }

  // scale: g / |s| after the update
  MPUCAL_INLINE void update_and_turn(const Parameters& p, const Constants& constants, const Steps& steps,
                                     const Lane (&P)[6], const Lane (&K)[3][3], const Lane (&plus)[3], Lane scale) {
    const Lane (&F)[3][3] = steps.turn.F;
    Lane FW[3][3], FP_rows[3][3], FNP_rows[3][3], direction[3];
    multiply(F, K, FK);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        FW[i][j] = nmadd(FK[i][2], p.D[2][j], nmadd(FK[i][1], p.D[1][j], nmadd(FK[i][0], p.D[0][j], F[i][j])));
    congruence(FW, carry);
    multiply(FW, P, FP_rows);
    Lane PF[6];
    multiply_to_symmetric(FP_rows, F, PF);
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      PF_beside[a] = PF[kSym[b][c]];
      PF_apart[a] = PF[kSym[b][b]] - PF[kSym[c][c]];
    }
    const Lane inverse_length = (1.0 / constants.gravity) * scale;
    multiply(F, plus, direction);
    for (int a = 0; a < 3; ++a) {
      direction[a] = inverse_length * direction[a];
      s[a] = constants.gravity * direction[a];
      for (int b = 0; b < 3; ++b) sc[a][b] = s[a] * steps.c[b];
    }
    normalise(direction, scale, FW, FNW);
    normalise(direction, scale, FK, FNK);
    normalise(direction, scale, FP_rows, FNP_rows);
    turn_round(FP_rows, FP);
    turn_round(FNP_rows, FNP);
  }

  // scale (I - direction direction') M
  MPUCAL_INLINE static void normalise(const Lane (&direction)[3], Lane scale, const Lane (&M)[3][3], Lane (&out)[3][3]) {
    for (int j = 0; j < 3; ++j) {
      const Lane along = madd(direction[2], M[2][j], madd(direction[1], M[1][j], direction[0] * M[0][j]));
      for (int i = 0; i < 3; ++i) out[i][j] = scale * nmadd(direction[i], along, M[i][j]);
    }
  }

  template <int G>
  MPUCAL_INLINE void turn(const Parameters& p, const Steps& steps) {
    Lane J[3][3], JK[3][3];
    steps.turn.left_jacobian(J);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) J[a][b] = steps.dt * J[a][b];
    multiply(J, p.K, JK);
    turn_round(JK, eta_b);
    if constexpr (G > Lanes::K / 4 + 1) turn_by_K(J, steps.rate, eta_K, eta_K2);
  }
};

}  // namespace
}  // namespace mpucal
