// The filter, compiled once for each instruction set: the including file names the function.
#include <algorithm>

#include "derivatives.hpp"

namespace mpucal {
namespace {

constexpr int kFours = 2;             // processed together, so that shared values stay in the first cache
constexpr long kBlock = 4 * kFours;

template <int lanes>
void run(const Parameters& p, const Series& series, const Constants& c, Result& result) {
  constexpr int G = groups_of(lanes);
  const Model model(p, c);
  const long all_steps = static_cast<long>(series.n) + 1;
  Steps steps[kFours];
  Predicted predicted[kFours] = {};
  Recursion recursion(model);
  [[maybe_unused]] Coefficients coefficients[G ? kFours : 1];
  [[maybe_unused]] Lane rows[kFours * kRowsOfFour][G ? G : 1];
  Derivatives<G> derivatives(p, c);
  Fisher<lanes> fisher;
  [[maybe_unused]] int end = 0;
  for (long k = 0; k < all_steps; k += kBlock) {
    const int count = static_cast<int>(std::min(kBlock, all_steps - k)), fours = (count + 3) / 4;
    for (int f = 0; f < fours; ++f) steps[f].read(model, series, k + 4 * f);
    recursion.run<(G > 0)>(steps, count, k == 0, predicted);
    if constexpr (G > 0) {
      for (int f = 0; f < fours; ++f) coefficients[f].template compute<G>(model, steps[f], predicted[f]);
      derivatives.run(coefficients, count, rows);
      fisher.add(rows, 6 * fours + 3 * count);
      for (; end < result.ends.count && result.ends.at[end] < k + count; ++end) {
        derivatives.write(result.gradient + end * 4 * G);
        fisher.write(result.fisher + end * 16 * G * G);
      }
    }
  }
  result.V = recursion.V();
  result.squares = recursion.squares();
}

}  // namespace

void MPUCAL_EVALUATE(const Parameters& p, const Series& given, const Constants& c, int lanes, Result& result) {
  constexpr double rest[3] = {0.0, 0.0, 0.0};
  const Series series = given.n > 0 ? given : Series{0, rest, rest, rest};
  switch (lanes) {
    case 0: return run<0>(p, series, c, result);
    case LanesUsed::accel: return run<LanesUsed::accel>(p, series, c, result);
    default: return run<LanesUsed::imu>(p, series, c, result);
  }
}

}  // namespace mpucal
