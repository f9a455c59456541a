// What the derivatives of four steps are linear in: functions of the recursion's s and P alone, shared by all
// parameters. Everything is computed for four steps at once; what a group of parameters needs as a vector over the
// parameters is then turned round, [step][...].
#pragma once
#include "filter.hpp"
#include "recursion.hpp"

namespace mpucal {
namespace {  // each build of the filter keeps its own

struct Coefficients {
  // the measurement, whitened by sqrt(w) L^-1 =: V
  Lane w, white[3][3], T[3][3], residual[3];  // V, V D, V e
  Lane dV[6];                                 // V(theta) by P: half of D'(S^-1 - w v v')D, off-diagonals doubled
  Lane q[4], dV_dD[4][3];                     // s + L r and 1; V(theta) by row j of D, by way of S
  Lane B[3], A_v[4];                          // rows of V A, first step only; A'v
  // the update and the turn: W = I - K D, N the derivative of g x / |x|
  Lane FW[3][3], FNW[3][3], FK[3][3], FNK[3][3];
  Lane v[3], z[3];                            // S^-1 e of the update, D'v
  Lane q_plus[4], FP[4][3], FNP[4][3];        // q after the update and 1; F P+, F N P+
  Lane s[3], PF[6];                           // after the turn
  Lane sc[3][3];                              // s_a c_b
  Lane eta_b[4][3], eta_K[4][3], eta_K2[4][3];  // of d(F x) = eta x (F x): for b_omega, K_xx to K_xz, K_yy to K_zz
  // Huber, where w < 1: what follows from dw, by d(e'S^-1 e)/2
  Lane robust[3], robust_P[6], v_nominal[3], z_nominal[3];
  // sigma_h and r
  Lane noise, noise_w, dV_dnoise, v2, FNK_v[3], FNKDL[4][3], TL[4][3];

  template <int G>
  MPUCAL_APART void compute(const Parameters& p, const Constants& c, const Steps& steps, const Predicted& predicted);
};

MPUCAL_INLINE void turn_round(const Lane (&x)[3], double last, Lane (&out)[4]) {
  transpose(x[0], x[1], x[2], all(last), out[0], out[1], out[2], out[3]);
}
MPUCAL_INLINE void turn_round(const Lane (&x)[3][3], Lane (&out)[4][3]) {
  for (int a = 0; a < 3; ++a) transpose(x[a][0], x[a][1], x[a][2], all(0.0), out[0][a], out[1][a], out[2][a], out[3][a]);
}

template <int G>
void Coefficients::compute(const Parameters& p, const Constants& constants, const Steps& steps, const Predicted& predicted) {
  constexpr bool hand = G > Lanes::r / 4;
  const Lane (&P)[6] = predicted.P;
  const Lane (&s0)[3] = predicted.s;
  const Lane (&F)[3][3] = steps.turn.F;
  w = predicted.w;
  const bool robust_too = at(w, 0) < 1.0 || at(w, 1) < 1.0 || at(w, 2) < 1.0 || at(w, 3) < 1.0;
  Lane A[3][3], S[6], e[3], VA[3][3];
  multiply(p.D, P, A);
  multiply_to_symmetric(A, p.D, steps.R, S);
  for (int a = 0; a < 3; ++a) e[a] = steps.y[a] - dot(p.D[a], s0);
  Adjugate<Lane> inverse(S);
  Lane reciprocal = whitener(S, inverse, white), w_inverse = all(1.0);
  if (robust_too) {
    w_inverse = 1.0 / w;
    const Lane root_w = root(w);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b <= a; ++b) white[a][b] = root_w * white[a][b];
    for (int a = 0; a < 3; ++a) S[kSym[a][a]] = madd(w_inverse - all(1.0), steps.R[a], S[kSym[a][a]]);
    inverse = Adjugate<Lane>(S);
    reciprocal = 1.0 / inverse.determinant;
  }
  multiply_lower(white, p.D, T);
  multiply_lower(white, A, VA);
  multiply_lower(white, e, residual);
  // the gradient by P and by the rows of D: (1/w) (X'Y - (X'r)(Y'r)') of two of T, V and V A
  Lane T_r[3], V_r[3], B_r[3];
  multiply_transposed(T, residual, T_r);
  multiply_transposed(VA, residual, B_r);
  V_r[2] = white[2][2] * residual[2];
  V_r[1] = madd(white[2][1], residual[2], white[1][1] * residual[1]);
  V_r[0] = madd(white[2][0], residual[2], madd(white[1][0], residual[1], white[0][0] * residual[0]));
  for (int m = 0; m < 6; ++m) {
    const int a = kRow[m], b = kCol[m];
    const Lane TT = madd(T[2][a], T[2][b], madd(T[1][a], T[1][b], T[0][a] * T[0][b]));
    dV[m] = (a == b ? 0.5 : 1.0) * w_inverse * nmadd(T_r[a], T_r[b], TT);
  }
  Lane by_D[3][3];
  for (int k = 0; k < 3; ++k) {
    Lane x = white[2][2] * VA[2][k];
    by_D[2][k] = w_inverse * nmadd(V_r[2], B_r[k], x);
    x = madd(white[2][1], VA[2][k], white[1][1] * VA[1][k]);
    by_D[1][k] = w_inverse * nmadd(V_r[1], B_r[k], x);
    x = madd(white[2][0], VA[2][k], madd(white[1][0], VA[1][k], white[0][0] * VA[0][k]));
    by_D[0][k] = w_inverse * nmadd(V_r[0], B_r[k], x);
  }
  turn_round(by_D, dV_dD);
  for (int a = 0; a < 3; ++a) B[a] = Lane{at(VA[a][0], 0), at(VA[a][1], 0), at(VA[a][2], 0), 0.0};
  Lane q0[3], q1[3], plus[3], A_v0[3];
  // the update
  Lane FA[3][3], x[3];
  for (int m = 0; m < 6; ++m) inverse.m[m] = reciprocal * inverse.m[m];
  multiply(inverse.m, e, v);
  multiply_transposed(p.D, v, z);
  multiply_transposed(A, v, A_v0);
  for (int a = 0; a < 3; ++a) {
    q0[a] = s0[a] + steps.L_r[a];
    q1[a] = q0[a] + A_v0[a];
    plus[a] = s0[a] + A_v0[a];
    x[a] = w_inverse * B_r[a];
  }
  turn_round(q0, 1.0, q);
  turn_round(q1, 1.0, q_plus);
  turn_round(x, 0.0, A_v);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) FA[i][j] = dot(F[i], A[j]);
  multiply(FA, inverse.m, FK);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      FW[i][j] = nmadd(FK[i][2], p.D[2][j], nmadd(FK[i][1], p.D[1][j], nmadd(FK[i][0], p.D[0][j], F[i][j])));
  Lane FP1[3][3], FNP1[3][3], direction[3];
  multiply(FW, P, FP1);
  multiply_to_symmetric(FP1, F, PF);
  const Lane inverse_length = 1.0 / root(dot(plus, plus)), scale = constants.gravity * inverse_length;
  multiply(F, plus, direction);
  for (int a = 0; a < 3; ++a) {
    direction[a] = inverse_length * direction[a];
    s[a] = constants.gravity * direction[a];
    for (int b = 0; b < 3; ++b) sc[a][b] = s[a] * steps.c[b];
  }
  const auto normalise = [&](const Lane (&M)[3][3], Lane (&out)[3][3]) {
    for (int j = 0; j < 3; ++j) {
      const Lane along = madd(direction[2], M[2][j], madd(direction[1], M[1][j], direction[0] * M[0][j]));
      for (int i = 0; i < 3; ++i) out[i][j] = scale * nmadd(direction[i], along, M[i][j]);
    }
  };
  normalise(FW, FNW);
  normalise(FK, FNK);
  normalise(FP1, FNP1);
  turn_round(FP1, FP);
  turn_round(FNP1, FNP);
  // the turn
  Lane J[3][3], JK[3][3];
  steps.turn.left_jacobian(J);
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) J[a][b] = steps.dt * J[a][b];
  multiply(J, p.K, JK);
  turn_round(JK, eta_b);
  if constexpr (G > Lanes::K / 4 + 1) {
    const Lane (&rate)[3] = steps.rate;
    for (int a = 0; a < 3; ++a) {
      const Lane xx = J[a][0] * rate[0], yy = J[a][1] * rate[1], zz = J[a][2] * rate[2];
      const Lane xy = madd(J[a][0], rate[1], J[a][1] * rate[0]);
      const Lane xz = madd(J[a][0], rate[2], J[a][2] * rate[0]);
      const Lane yz = madd(J[a][1], rate[2], J[a][2] * rate[1]);
      const Lane zero = all(0.0);
      transpose(zero, zero - xx, zero - xy, zero - xz, eta_K[0][a], eta_K[1][a], eta_K[2][a], eta_K[3][a]);
      transpose(zero - yy, zero - yz, zero - zz, zero, eta_K2[0][a], eta_K2[1][a], eta_K2[2][a], eta_K2[3][a]);
    }
  }
  // Huber
  if (robust_too) {
    for (int a = 0; a < 3; ++a) {
      v_nominal[a] = w_inverse * V_r[a];
      z_nominal[a] = w_inverse * T_r[a];
    }
    const Lane kappa = 1.0 / dot(residual, residual);  // 1 / (w e'S^-1 e)
    Lane Rv[3];
    for (int a = 0; a < 3; ++a) Rv[a] = kappa * steps.R[a] * v[a];
    for (int a = 0; a < 3; ++a) robust[a] = dot(FNK[a], Rv);
    for (int m = 0; m < 6; ++m) {
      const int a = kRow[m], b = kCol[m];
      robust_P[m] = kappa * madd(FK[a][2] * steps.R[2], FK[b][2],
                                 madd(FK[a][1] * steps.R[1], FK[b][1], FK[a][0] * steps.R[0] * FK[b][0]));
    }
  }
  if constexpr (hand) {
    noise = steps.noise;
    noise_w = w_inverse * noise;
    v2 = all(0.0);
    Lane trace = all(0.0);
    for (int a = 0; a < 3; ++a) {
      v2 = madd(V_r[a], V_r[a], v2);
      for (int b = 0; b <= a; ++b) trace = madd(white[a][b], white[a][b], trace);
      FNK_v[a] = noise_w * dot(FNK[a], v);
    }
    dV_dnoise = 0.5 * noise_w * (trace - v2);
    v2 = 0.5 * steps.noise * w_inverse * w_inverse * v2;
    Lane TL0[3][3], DL[3][3], FNKDL0[3][3];
    multiply(T, steps.L, TL0);
    multiply(p.D, steps.L, DL);
    multiply(FNK, DL, FNKDL0);
    turn_round(TL0, TL);
    turn_round(FNKDL0, FNKDL);
  }
}

}  // namespace
}  // namespace mpucal
