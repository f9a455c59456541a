// The filter, compiled once for each instruction set: the including file names the function.
#include <algorithm>
#include <cmath>

#include "derivatives.hpp"

namespace mpucal {
namespace {

constexpr int kFours = 2;             // worked on together: what they share stays in the first cache
constexpr long kBlock = 4 * kFours;

// Whitened innovations and s of the samples among these steps
void trace(const Parameters& p, const Steps* steps, const Predicted* predicted, long k, int count, Result& result) {
  for (int i = 0; i < count; ++i) {
    const long sample = k + i - 1;
    if (sample < 0) continue;
    const Steps& four = steps[i / 4];
    const int t = i % 4;
    double s[3], P[6], A[3][3], S[6], e[3], white[3][3], residual[3];
    for (int a = 0; a < 3; ++a) s[a] = at(predicted[i / 4].s[a], t);
    for (int m = 0; m < 6; ++m) P[m] = at(predicted[i / 4].P[m], t);
    multiply(p.D, P, A);
    multiply_to_symmetric(A, p.D, S);
    for (int a = 0; a < 3; ++a) {
      S[kSym[a][a]] += at(four.R[a], t);
      e[a] = at(four.y[a], t) - dot(p.D[a], s);
    }
    whitener(S, Adjugate<double>(S), white);
    multiply_lower(white, e, residual);
    for (int a = 0; a < 3; ++a) {
      if (result.innovation) result.innovation[3 * sample + a] = residual[a];
      if (result.gravity) result.gravity[3 * sample + a] = s[a];
    }
  }
}

template <int G>
void run(const Parameters& p, const Series& series, const Constants& c, Result& result) {
  const bool kept = G > 0 || result.innovation || result.gravity;
  const long all_steps = static_cast<long>(series.n) + 1;
  Steps steps[kFours];
  Predicted predicted[kFours] = {};
  Recursion recursion(p, c);
  [[maybe_unused]] Coefficients coefficients[G ? kFours : 1];
  [[maybe_unused]] Lane rows[kFours * kRowsOfFour][G ? G : 1];
  Derivatives<G> derivatives(p, c);
  Fisher<G> fisher;
  for (long k = 0; k < all_steps; k += kBlock) {
    const int count = static_cast<int>(std::min(kBlock, all_steps - k)), fours = (count + 3) / 4;
    for (int f = 0; f < fours; ++f) steps[f].read(p, series, c, k + 4 * f);
    if (kept)
      recursion.run<true>(steps, count, k == 0, predicted);
    else
      recursion.run<false>(steps, count, k == 0, predicted);
    if (G == 0 && kept) trace(p, steps, predicted, k, count, result);
    if constexpr (G > 0) {
      for (int f = 0; f < fours; ++f) coefficients[f].template compute<G>(p, c, steps[f], predicted[f]);
      derivatives.run(coefficients, count, rows);
      fisher.add(rows, 6 * fours + 3 * count);
    }
  }
  result.V = recursion.V();
  result.squares = recursion.squares();
  if constexpr (G > 0) {
    derivatives.write(result.gradient);
    fisher.write(result.fisher);
  }
}

}  // namespace

void MPUCAL_EVALUATE(const Parameters& p, const Series& given, const Constants& c, int groups, Result& result) {
  constexpr double rest[3] = {0.0, 0.0, 0.0};
  const Series series = given.n > 0 ? given : Series{0, rest, rest, rest};
  switch (groups) {
    case 0: return run<0>(p, series, c, result);
    case 5: return run<5>(p, series, c, result);
    case 6: return run<6>(p, series, c, result);
    default: return run<7>(p, series, c, result);
  }
}

}  // namespace mpucal
