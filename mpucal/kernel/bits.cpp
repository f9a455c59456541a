// See bits.hpp.
#include "bits.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

namespace mpucal {

void stuck_odds(const std::int32_t* counts, const bool* gap, std::size_t n, const std::int64_t* edges,
                std::size_t pieces, double errors, double sound, double* odds) {
  constexpr std::int64_t word = 0xFFFF, unsign = word >> 1, leap = unsign - (unsign >> 4);
  constexpr std::size_t factors = 64;  // of a product, each of 0.1 to 45, which a double holds
  // the odds of a bit that stays, and of one that changes, where a sound one does so in this share of the steps
  struct Odds {
    double of[2];
  };
  const auto odds_of = [&](double share) { return Odds{{(1.0 - errors) / (1.0 - share), errors / share}}; };
  const Odds by_chance = odds_of(0.5), nearly_always = odds_of(sound);
  std::fill_n(odds, kBits * pieces * 3, 0.0);
  for (std::size_t k = 0; k < pieces; ++k) {
    double product[3][kBits];
    std::fill_n(product[0], 3 * kBits, 1.0);
    const auto take_logs = [&] {
      for (std::size_t j = 0; j < 3; ++j)
        for (std::size_t bit = 0; bit < kBits; ++bit)
          odds[(bit * pieces + k) * 3 + j] += std::log(std::exchange(product[j][bit], 1.0));
    };
    const std::size_t last = k + 1 < pieces ? static_cast<std::size_t>(edges[k + 1]) : n - 1;
    for (std::size_t i = static_cast<std::size_t>(edges[k]); i < last; ++i) {
      if (i % factors == 0) take_logs();
      if (gap[i + 1]) continue;
      for (std::size_t j = 0; j < 3; ++j) {
        const std::int64_t before = counts[3 * i + j], after = counts[3 * i + 3 + j];
        const auto changed = static_cast<std::uint64_t>((before ^ after) & word);
        const auto step = static_cast<std::uint64_t>(std::max<std::int64_t>(std::abs(after - before), 1));
        const auto add = [&](int bit, const Odds& is) { product[j][bit] *= is.of[changed >> bit & 1]; };
        // A value anywhere in a bit's period, of two halves, crosses its end; longer steps leave the bit to chance.
        const int size = std::ilogb(static_cast<double>(step));
        const auto odds_at = [&](int bit) {
          if (bit != size) return bit < size ? by_chance : nearly_always;
          return odds_of(std::clamp(std::ldexp(2.0, bit) / static_cast<double>(step) - 1.0, errors, sound));
        };
        const int bits = std::min(std::ilogb(static_cast<double>(changed)), kBits - 1);
        for (int bit = 0; bit < bits; ++bit) add(bit, odds_at(bit));
        // Without its sign a value that passes zero leaps from one end of the range to the other. A blow does not.
        if (std::abs((after & unsign) - (before & unsign)) > leap) add(kBits - 1, odds_at(kBits - 1));
      }
    }
    take_logs();
  }
}

}  // namespace mpucal
