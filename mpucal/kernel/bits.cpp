// See bits.hpp.
#include "bits.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace mpucal {

void stuck_odds(const std::int32_t* counts, const bool* gap, std::size_t n, const std::int64_t* edges,
                std::size_t pieces, double errors, double sound, double* odds) {
  constexpr std::int64_t word = 0xFFFF, unsign = word >> 1, leap = 1 << (kBits - 2);
  const auto of_share = [&](bool changes, double share) {
    return std::log(changes ? errors / share : (1.0 - errors) / (1.0 - share));
  };
  struct Odds {
    double share, of[2];  // log odds of a bit that stays, and of one that changes
  };
  const auto odds_of = [&](double share) { return Odds{share, {of_share(false, share), of_share(true, share)}}; };
  // most steps have one of these shares
  const Odds usual[3] = {odds_of(0.5), odds_of(errors), odds_of(sound)};
  std::fill_n(odds, kBits * pieces * 3, 0.0);
  for (std::size_t k = 0; k < pieces; ++k) {
    const std::size_t last = k + 1 < pieces ? static_cast<std::size_t>(edges[k + 1]) : n - 1;
    for (std::size_t i = static_cast<std::size_t>(edges[k]); i < last; ++i) {
      if (gap[i + 1]) continue;
      for (std::size_t j = 0; j < 3; ++j) {
        const std::int64_t before = counts[3 * i + j], after = counts[3 * i + 3 + j];
        const std::int64_t changed = (before ^ after) & word, step = std::max<std::int64_t>(std::abs(after - before), 1);
        // Without its sign a value that passes zero leaps from one end of the range to the other.
        const bool leaps = std::abs((after & unsign) - (before & unsign)) > leap;
        const auto add = [&](int bit) {
          const bool changes = changed >> bit & 1;
          double share = 0.5;
          // A value anywhere in the bit's period, of two halves, crosses its end; longer steps leave the bit to chance.
          if (step >> bit < 2)
            share = std::clamp(std::ldexp(2.0, bit) / static_cast<double>(step) - 1.0, errors, sound);
          const auto* const known =
              std::find_if(usual, usual + 3, [&](const Odds& each) { return each.share == share; });
          odds[(bit * pieces + k) * 3 + j] += known < usual + 3 ? known->of[changes] : of_share(changes, share);
        };
        for (int bit = 0; bit < kBits - 1 && changed >> bit > 1; ++bit) add(bit);
        if (leaps) add(kBits - 1);
      }
    }
  }
}

}  // namespace mpucal
