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
  const double by_chance[2] = {of_share(false, 0.5), of_share(true, 0.5)};
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
          odds[(bit * pieces + k) * 3 + j] += share == 0.5 ? by_chance[changes] : of_share(changes, share);
        };
        for (int bit = 0; bit < kBits - 1 && changed >> bit > 1; ++bit) add(bit);
        if (leaps) add(kBits - 1);
      }
    }
  }
}

}  // namespace mpucal
