// The hand filter's body, compiled once for each instruction set: the including file names the function.
//
// Everything is held in the first body frame, in which F = I: only the measurement knows the turn C since then. The four
// vectors of the state are the four places of a lane, so that the chain is one 4 x 4 matrix for all axes.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>
#include <utility>

#include "chain.hpp"
#include "fisher.hpp"
#include "hand.hpp"
#include "lane.hpp"
#include "matrix.hpp"
#include "rotation.hpp"

namespace mpucal {
namespace {

constexpr int kGroups = Lanes::most / 4;
constexpr int kRows = 48;
constexpr double kLongestStep = 0.2;       // s: over a gap the hand's travel is as good as forgotten
constexpr double kSpeedOfReset = 0.04;     // s: a rest that trembles by a moves at this times a
constexpr int kState = 4, kS = 0, kA = 3;  // places of s and a in (s, p, v, a)

// One step, as the derivatives need it.
struct HandStep {
  Chain chain;
  bool reset = false;
  Lane eta[3][3] = {};     // what the gyro's parameters turn; see turning
  double x[3][kState];     // before the update, by axis
  double q[3];             // E s + a + L r, in the body
  double delay[3];         // D [omega]x s
  double lever[3][3];      // D L
  double Hs[3][3], Ha[3][3];
  double white[3][3];      // w^(1/2) L^-1
  double residual[3];      // w^(1/2) L^-1 e
  double K[3][3][kState];  // gain: axis, measurement, place
  double direction[3], shrink;  // of s after the update, unit; g / |s + K e|
};

// n x (a, b, c)
MPUCAL_INLINE void cross_product(const Lane (&n)[3], double a, double b, double c, Lane (&x)[3]) {
  x[0] = nmadd(b, n[2], c * n[1]);
  x[1] = nmadd(c, n[0], a * n[2]);
  x[2] = nmadd(a, n[1], b * n[0]);
}

// the adjugate becomes the inverse; v = S^-1 e
MPUCAL_INLINE void solve(Adjugate<double>& inverse, const double (&e)[3], double (&v)[3]) {
  const double reciprocal = 1.0 / inverse.determinant;
  for (double& m : inverse.m) m *= reciprocal;
  multiply(inverse.m, e, v);
}

template <bool kDerive>
class HandFilter {
 public:
  HandFilter(const HandParameters& p, const HandConstants& c) : p_(p), c_(c) {
    for (int a = 0; a < 3; ++a) x_[a] = Lane{c.gravity * p.u[a], 0.0, 0.0, 0.0};
    std::memset(static_cast<void*>(P_), 0, sizeof P_);
    if constexpr (kDerive) {
      std::memset(static_cast<void*>(dx_), 0, sizeof dx_);
      std::memset(static_cast<void*>(gradient_), 0, sizeof gradient_);
      for (int a = 0; a < 3; ++a) {
        put(dx_[Lanes::tilt0 / 4][kS][a], Lanes::tilt0 % 4, c.gravity * p.du[0][a]);
        put(dx_[Lanes::tilt1 / 4][kS][a], Lanes::tilt1 % 4, c.gravity * p.du[1][a]);
      }
    }
  }

  void run(const HandSeries& series, HandResult& result) {
    whiten_ = result.innovation;
    const double still[3] = {0.0, 0.0, 0.0};
    double R[3], squares = 0.0;
    for (int a = 0; a < 3; ++a) R[a] = c_.Sigma_a[a] / c_.flat_n;
    observe(still, still, 0.0);
    measure(c_.flat_y, R, INFINITY);
    for (std::size_t i = 0; i < series.n; ++i) {
      propagate(series, i);
      if (series.reset && series.reset[i] >= 0.0) reset(series.reset[i]);
      observe(series.rate ? series.rate + 3 * i : still, series.alpha ? series.alpha + 3 * i : still, p_.tau);
      for (int a = 0; a < 3; ++a)
        R[a] = (series.r_scale ? series.r_scale[i] : 1.0) * c_.Sigma_a[a] + (series.r_extra ? series.r_extra[i] : 0.0);
      record_state(result, i);
      squares += measure(series.y + 3 * i, R, c_.huber);
      if (result.innovation) std::memcpy(result.innovation + 3 * i, whitened_, sizeof whitened_);
    }
    finish(result, squares);
  }

 private:
  void propagate(const HandSeries& series, std::size_t i) {
    const double dt = series.dt[i], *omega = series.omega + 3 * i;
    double rate[3];
    for (int a = 0; a < 3; ++a) rate[a] = omega[a] - p_.b_omega[a];
    Turn<double> turn;
    for (int a = 0; a < 3; ++a) turn.phi[a] = -dt * dot(p_.K[a], rate);
    turn.compute();
    double turned[3][3];
    multiply(turn.F, C_, turned);
    std::memcpy(C_, turned, sizeof C_);
    step_.chain.advance(std::min(dt, kLongestStep), c_.lam);
    step_.reset = false;
    const double q_scale = dt * dt * (series.q_scale ? series.q_scale[i] : 1.0);
    double c[3];
    for (int a = 0; a < 3; ++a) c[a] = q_scale * c_.Sigma_omega[a] + (series.q_extra ? series.q_extra[i] : 0.0);
    along_the_chain(series.jerk ? series.jerk[i] : 0.0, c);
    if constexpr (kDerive) turning(turn, rate, dt);
  }

  // x <- Phi x, P <- Phi P Phi' + the noise of the jerk and of the gyro
  MPUCAL_INLINE void along_the_chain(double jerk, const double (&c)[3]) {
    const auto &Phi = step_.chain.Phi, &Q = step_.chain.Q;
    Lane column[kState];
    column[kS] = Lane{1.0, 0.0, 0.0, 0.0};
    for (int k = 0; k < 3; ++k) column[k + 1] = Lane{0.0, Phi[0][k], Phi[1][k], Phi[2][k]};
    for (int a = 0; a < 3; ++a) x_[a] = across(x_[a], column);
    for (int m = 0; m < 6; ++m) {
      Lane(&P)[kState] = P_[m];
      const Lane p = P[1], v = P[2], a = P[3];
      P[kS] = across(P[kS], column);
      for (int k = 0; k < 3; ++k)
        P[k + 1] = across(madd(Phi[k][2], a, madd(Phi[k][1], v, all(Phi[k][0]) * p)), column);
    }
    for (int k = 0; k < 3; ++k) {
      const Lane noise = all(jerk) * Lane{0.0, Q[k][0], Q[k][1], Q[k][2]};
      for (int a = 0; a < 3; ++a) P_[kSym[a][a]][k + 1] = P_[kSym[a][a]][k + 1] + noise;
    }
    // sum of c_i (s x C_i) (s x C_i)', C_i the body's axes
    double N[6] = {0, 0, 0, 0, 0, 0};
    const double s[3] = {at(x_[0], kS), at(x_[1], kS), at(x_[2], kS)};
    for (int i = 0; i < 3; ++i) {
      const double *u = C_[i], n[3] = {s[1] * u[2] - s[2] * u[1], s[2] * u[0] - s[0] * u[2], s[0] * u[1] - s[1] * u[0]};
      for (int m = 0; m < 6; ++m) N[m] += c[i] * n[kRow[m]] * n[kCol[m]];
    }
    for (int m = 0; m < 6; ++m) P_[m][kS] = P_[m][kS] + Lane{N[m], 0.0, 0.0, 0.0};
  }

  // row times matrix
  static MPUCAL_INLINE Lane across(Lane row, const Lane (&M)[kState]) {
    Lane y = all(at(row, 0)) * M[0];
    for (int k = 1; k < kState; ++k) y = madd(all(at(row, k)), M[k], y);
    return y;
  }

  // d(exp([phi]x) x) = eta x (exp([phi]x) x), eta = J_l(phi) dphi, here in the first frame
  MPUCAL_INLINE void turning(const Turn<double>& turn, const double (&rate)[3], double dt) {
    double J[3][3], CJ[3][3], CJK[3][3];
    turn.left_jacobian(J);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) CJ[a][b] = -dt * (C_[0][a] * J[0][b] + C_[1][a] * J[1][b] + C_[2][a] * J[2][b]);
    multiply(CJ, p_.K, CJK);
    Lane(&eta)[3][3] = step_.eta;
    for (int a = 0; a < 3; ++a) {
      const double* j = CJ[a];
      eta[0][a] = Lane{-CJK[a][0], -CJK[a][1], -CJK[a][2], 0.0};
      eta[1][a] = Lane{0.0, j[0] * rate[0], j[0] * rate[1] + j[1] * rate[0], j[0] * rate[2] + j[2] * rate[0]};
      eta[2][a] = Lane{j[1] * rate[1], j[1] * rate[2] + j[2] * rate[1], j[2] * rate[2], 0.0};
    }
  }

  // p = v = a = 0, uncorrelated with all
  void reset(double sigma) {
    const Lane s_alone{1.0, 0.0, 0.0, 0.0};
    step_.reset = true;
    for (int a = 0; a < 3; ++a) x_[a] = x_[a] * s_alone;
    for (int m = 0; m < 6; ++m) {
      P_[m][kS] = P_[m][kS] * s_alone;
      for (int k = 1; k < kState; ++k) P_[m][k] = all(0.0);
    }
    const double speed = kSpeedOfReset * sigma;
    for (int a = 0; a < 3; ++a) {
      P_[kSym[a][a]][2] = Lane{0.0, 0.0, speed * speed, 0.0};
      P_[kSym[a][a]][kA] = Lane{0.0, 0.0, 0.0, sigma * sigma};
    }
  }

  // H = D (E C, 0, 0, C) and D (E s + a + L r)
  MPUCAL_INLINE void observe(const double* rate, const double* alpha, double tau) {
    HandStep& k = step_;
    double rows[3][3], L[3][3], s[3], a[3];
    for (int j = 0; j < 3; ++j) {
      const double* d = p_.D[j];
      rows[j][0] = d[0] + tau * (d[1] * rate[2] - d[2] * rate[1]);
      rows[j][1] = d[1] + tau * (d[2] * rate[0] - d[0] * rate[2]);
      rows[j][2] = d[2] + tau * (d[0] * rate[1] - d[1] * rate[0]);
    }
    multiply(p_.D, C_, k.Ha);
    multiply(rows, C_, k.Hs);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < kState; ++j) k.x[i][j] = at(x_[i], j);
    const double w2 = rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) L[i][j] = rate[i] * rate[j] - (i == j ? w2 : 0.0);
    L[0][1] -= alpha[2], L[1][0] += alpha[2];
    L[0][2] += alpha[1], L[2][0] -= alpha[1];
    L[1][2] -= alpha[0], L[2][1] += alpha[0];
    for (int i = 0; i < 3; ++i) {
      s[i] = C_[i][0] * k.x[0][kS] + C_[i][1] * k.x[1][kS] + C_[i][2] * k.x[2][kS];
      a[i] = C_[i][0] * k.x[0][kA] + C_[i][1] * k.x[1][kA] + C_[i][2] * k.x[2][kA];
    }
    const double swept[3] = {rate[1] * s[2] - rate[2] * s[1], rate[2] * s[0] - rate[0] * s[2],
                             rate[0] * s[1] - rate[1] * s[0]};
    for (int i = 0; i < 3; ++i) {
      k.q[i] = s[i] + tau * swept[i] + a[i] + dot(L[i], p_.r);
      s_body_[i] = s[i];
      a_body_[i] = a[i];
    }
    if constexpr (kDerive) {
      multiply(p_.D, L, k.lever);
      for (int j = 0; j < 3; ++j) k.delay[j] = dot(p_.D[j], swept);
    }
  }

  // e, S, V, and the update; returns e' S^-1 e
  MPUCAL_INLINE double measure(const double* y, const double (&R)[3], double huber) {
    HandStep& k = step_;
    double e[3], S[6], v[3];
    Lane A[3][3];  // covariance of the state along an axis with a measurement
    for (int j = 0; j < 3; ++j) e[j] = y[j] - dot(p_.D[j], k.q) - p_.b_a[j];
    cross_covariance(A);
    for (int m = 0; m < 6; ++m) {
      const int i = kRow[m], j = kCol[m];
      S[m] = 0.0;
      for (int a = 0; a < 3; ++a) S[m] += k.Hs[i][a] * at(A[a][j], kS) + k.Ha[i][a] * at(A[a][j], kA);
    }
    const double nominal[6] = {S[0] + R[0], S[1], S[2], S[3] + R[1], S[4], S[5] + R[2]};
    const Adjugate<double> nominal_adjugate(nominal);
    Adjugate<double> adjugate = nominal_adjugate;
    solve(adjugate, e, v);
    determinants_ *= adjugate.determinant;
    if (++measured_ % 8 == 0) log_determinants_ += std::log(determinants_), determinants_ = 1.0;
    const double squares = dot(e, v);
    const double w = weight(squares, huber);
    if (kDerive || whiten_) {
      double white[3][3];
      whitener(nominal, nominal_adjugate, white);
      const double root = std::sqrt(w);
      multiply_lower(white, e, whitened_);
      for (int a = 0; a < 3; ++a) {
        k.residual[a] = root * whitened_[a];
        for (int b = 0; b <= a; ++b) k.white[a][b] = root * white[a][b];
      }
    }
    if (w < 1.0) {
      const double inflated[6] = {S[0] + R[0] / w, S[1], S[2], S[3] + R[1] / w, S[4], S[5] + R[2] / w};
      adjugate = Adjugate<double>(inflated);
      solve(adjugate, e, v);
    }
    update(A, adjugate, v);
    if constexpr (kDerive) {
      for_each<kGroups>([&](auto g) { differentiate<g>(); });
      filled_ += 3;
      if (filled_ == kRows) gather();
    }
    return squares;
  }

  MPUCAL_INLINE void cross_covariance(Lane (&A)[3][3]) const {
    const HandStep& k = step_;
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        // of the state along a with s and a along b
        const Lane(&P)[kState] = P_[kSym[a][b]];
        const Lane s = a < b ? Lane{at(P[0], kS), at(P[1], kS), at(P[2], kS), at(P[3], kS)} : P[kS];
        const Lane m = a < b ? Lane{at(P[0], kA), at(P[1], kA), at(P[2], kA), at(P[3], kA)} : P[kA];
        for (int j = 0; j < 3; ++j) {
          A[a][j] = b == 0 ? all(k.Hs[j][b]) * s : madd(k.Hs[j][b], s, A[a][j]);
          A[a][j] = madd(k.Ha[j][b], m, A[a][j]);
        }
      }
    }
  }

  // adds rho to V
  double weight(double squares, double huber) {
    const double threshold = huber * huber;
    if (!(squares > threshold)) {
      V_ += 0.5 * squares;
      return 1.0;
    }
    if (c_.tail != 0.0) {
      V_ += 0.5 * threshold * (1.0 + std::log(squares / threshold));
      return threshold / squares;
    }
    const double root = std::sqrt(squares);
    V_ += huber * (root - 0.5 * huber);
    return huber / root;
  }

  MPUCAL_INLINE void update(const Lane (&A)[3][3], Adjugate<double>& inverse, const double (&v)[3]) {
    HandStep& k = step_;
    Lane K[3][3];
    for (int a = 0; a < 3; ++a) {
      for (int j = 0; j < 3; ++j) {
        K[a][j] = all(inverse.m[kSym[0][j]]) * A[a][0];
        K[a][j] = madd(inverse.m[kSym[1][j]], A[a][1], K[a][j]);
        K[a][j] = madd(inverse.m[kSym[2][j]], A[a][2], K[a][j]);
        for (int i = 0; i < kState; ++i) k.K[a][j][i] = at(K[a][j], i);
        x_[a] = madd(v[j], A[a][j], x_[a]);
      }
    }
    for (int m = 0; m < 6; ++m)
      for (int i = 0; i < kState; ++i)
        for (int j = 0; j < 3; ++j) P_[m][i] = madd(-at(K[kRow[m]][j], i), A[kCol[m]][j], P_[m][i]);
    const double s[3] = {at(x_[0], kS), at(x_[1], kS), at(x_[2], kS)}, inverse_norm = 1.0 / std::sqrt(dot(s, s));
    k.shrink = c_.gravity * inverse_norm;
    for (int a = 0; a < 3; ++a) {
      k.direction[a] = s[a] * inverse_norm;
      x_[a] = x_[a] * Lane{k.shrink, 1.0, 1.0, 1.0};
    }
  }

  // dx of one group through the whole step; its rows of the Fisher matrix
  template <int g>
  MPUCAL_INLINE void differentiate() {
    const HandStep& k = step_;
    Lane(&dx)[kState][3] = dx_[g];
    transport<g>(dx);
    Lane de[3];
    for (int j = 0; j < 3; ++j) {
      de[j] = all(-k.Hs[j][0]) * dx[kS][0];
      de[j] = madd(-k.Hs[j][1], dx[kS][1], de[j]);
      de[j] = madd(-k.Hs[j][2], dx[kS][2], de[j]);
      for (int b = 0; b < 3; ++b) de[j] = madd(-k.Ha[j][b], dx[kA][b], de[j]);
      if constexpr (g == Lanes::tau / 4) de[j] = de[j] + Lane{0.0, 0.0, 0.0, -k.delay[j]};
      if constexpr (g == Lanes::r / 4) de[j] = de[j] + Lane{-k.lever[j][0], -k.lever[j][1], -k.lever[j][2], 0.0};
      if constexpr (g < 3)
        if (j == g) de[j] = de[j] + Lane{-k.q[0], -k.q[1], -k.q[2], -1.0};
    }
    for (int a = 0; a < 3; ++a) {
      Lane row = all(k.white[a][0]) * de[0];
      for (int b = 1; b <= a; ++b) row = madd(k.white[a][b], de[b], row);
      rows_[filled_ + a][g] = row;
      gradient_[g] = madd(k.residual[a], row, gradient_[g]);
    }
    for (int a = 0; a < 3; ++a)
      for (int j = 0; j < 3; ++j)
        for (int i = 0; i < kState; ++i) dx[i][a] = madd(k.K[a][j][i], de[j], dx[i][a]);
    // s keeps its length
    const double* u = k.direction;
    const Lane along = madd(-u[2], dx[kS][2], madd(-u[1], dx[kS][1], all(-u[0]) * dx[kS][0]));
    for (int a = 0; a < 3; ++a) dx[kS][a] = all(k.shrink) * madd(u[a], along, dx[kS][a]);
  }

  // dx <- Phi dx + eta x (Phi x)
  template <int g>
  MPUCAL_INLINE void transport(Lane (&dx)[kState][3]) {
    const HandStep& k = step_;
    const auto& Phi = k.chain.Phi;
    for (int a = 0; a < 3; ++a) {
      const Lane p = dx[1][a], v = dx[2][a], m = dx[kA][a];
      for (int i = 0; i < 3; ++i) dx[i + 1][a] = madd(Phi[i][2], m, madd(Phi[i][1], v, all(Phi[i][0]) * p));
    }
    if constexpr (g >= Lanes::b_omega / 4 && g <= Lanes::tau / 4) {
      for (int i = 0; i < kState; ++i) {
        Lane turned[3];
        cross_product(k.eta[g - Lanes::b_omega / 4], k.x[0][i], k.x[1][i], k.x[2][i], turned);
        for (int a = 0; a < 3; ++a) dx[i][a] = dx[i][a] + turned[a];
      }
    }
    if (k.reset)
      for (int i = 1; i < kState; ++i)
        for (int a = 0; a < 3; ++a) dx[i][a] = all(0.0);
  }

  void record_state(HandResult& result, std::size_t i) const {
    if (result.gravity) std::memcpy(result.gravity + 3 * i, s_body_, sizeof s_body_);
    if (result.motion) std::memcpy(result.motion + 3 * i, a_body_, sizeof a_body_);
  }

  void gather() {
    fisher_.add(rows_, filled_);
    filled_ = 0;
  }

  void finish(HandResult& result, double squares) {
    result.V = V_ + 0.5 * (log_determinants_ + std::log(determinants_));
    result.squares = squares;
    if constexpr (kDerive) {
      std::memcpy(result.gradient, gradient_, sizeof gradient_);
      gather();
      fisher_.write(result.fisher);
    }
  }

  const HandParameters& p_;
  const HandConstants& c_;
  double C_[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};  // the turn from the first body frame to this one
  Lane x_[3];          // (s, p, v, a) along each axis
  Lane P_[6][kState];  // [kSym[a][b]][i]: of place i along axis a with (s, p, v, a) along axis b >= a
  double V_ = 0.0, s_body_[3], a_body_[3], whitened_[3];
  bool whiten_ = false;
  unsigned measured_ = 0;
  double determinants_ = 1.0, log_determinants_ = 0.0;  // a few at a time
  HandStep step_;
  Lane dx_[kDerive ? kGroups : 1][kState][3], gradient_[kDerive ? kGroups : 1];
  Fisher<kDerive ? kGroups : 0> fisher_;
  Lane rows_[kDerive ? kRows : 1][kGroups];  // not yet in the Fisher matrix
  int filled_ = 0;
};

}  // namespace

void MPUCAL_EVALUATE_HAND(const HandParameters& p, const HandSeries& series, const HandConstants& c, HandResult& result) {
  if (result.gradient)
    HandFilter<true>(p, c).run(series, result);
  else
    HandFilter<false>(p, c).run(series, result);
}

}  // namespace mpucal
