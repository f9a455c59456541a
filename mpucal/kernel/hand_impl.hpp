// The hand's filter, compiled once for each instruction set: the including file names the function.
#include <algorithm>
#include <cmath>

#include "hand_derivatives.hpp"

namespace mpucal {
namespace {

constexpr int kFours = 4;  // processed together, so that shared values stay in the first cache
constexpr long kBlock = 4 * kFours;

// Whitened innovations and s of the samples among these steps
void trace(const HandSteps* steps, const HandPredicted* predicted, long k, int count, HandResult& result) {
  for (int i = 0; i < count; ++i) {
    const long sample = k + i - 1;
    if (sample < 0) continue;
    const HandSteps& four = steps[i / 4];
    const HandPredicted& met = predicted[i / 4];
    const int t = i % 4;
    Lane white[3][3], residual[3], s[3];
    whitener(met.S, Adjugate<Lane>(met.S), white);
    multiply_lower(white, met.e, residual);
    multiply(four.C, met.s, s);
    for (int j = 0; j < 3; ++j) {
      result.innovation[3 * sample + j] = at(residual[j], t);
      result.gravity[3 * sample + j] = at(s[j], t);
    }
  }
}

// G groups of derivatives, or none
template <int G, bool traced = false>
void run(const HandParameters& p, const HandSeries& series, const HandConstants& c, HandResult& result) {
  const long all_steps = static_cast<long>(series.n) + 1;
  Lane C[3] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
  HandSteps steps[kFours];
  HandPredicted predicted[kFours] = {};
  HandRecursion recursion(p, c);
  [[maybe_unused]] HandCoefficients coefficients[kFours];
  [[maybe_unused]] Lane rows[3 * kBlock][G ? G : 1];
  HandDerivatives<G> derivatives(p, c.gravity);
  Fisher<G == kHandGroups ? LanesUsed::hand : 4 * G> fisher;
  [[maybe_unused]] int end = 0;
  for (long k = 0; k < all_steps; k += kBlock) {
    const int count = static_cast<int>(std::min(kBlock, all_steps - k)), fours = (count + 3) / 4;
    for (int f = 0; f < fours; ++f) steps[f].read(p, series, c, k + 4 * f, C);
    recursion.run<(G > 0 || traced)>(steps, count, k == 0, predicted);
    if constexpr (traced) trace(steps, predicted, k, count, result);
    if constexpr (G > 0) {
      for (int f = 0; f < fours; ++f) coefficients[f].compute(p, c.gravity, steps[f], predicted[f]);
      derivatives.run(steps, predicted, coefficients, count, rows);
      fisher.add(rows, 3 * count);
      constexpr long lanes = 4 * G;
      for (; end < result.ends.count && result.ends.at[end] < k + count; ++end) {
        derivatives.write(result.gradient + end * lanes);
        fisher.write(result.fisher + end * lanes * lanes);
      }
    }
  }
  result.V = recursion.V();
  result.squares = recursion.squares();
}

}  // namespace

void MPUCAL_EVALUATE_HAND(const HandParameters& p, const HandSeries& given, const HandConstants& c, HandResult& result) {
  constexpr double rest[3] = {0.0, 0.0, 0.0};
  HandSeries series = given;
  if (given.n == 0) series = HandSeries{{0, rest, rest, rest}};
  if (result.gradient && series.force)
    run<kHandGroups + kGroupsOfS>(p, series, c, result);
  else if (result.gradient)
    run<kHandGroups>(p, series, c, result);
  else if (result.innovation)
    run<0, true>(p, series, c, result);
  else
    run<0>(p, series, c, result);
}

}  // namespace mpucal
