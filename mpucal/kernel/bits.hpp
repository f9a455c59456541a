// Odds that bits of counts are stuck, against sound ones.
#pragma once
#include <cstddef>
#include <cstdint>

namespace mpucal {

constexpr int kBits = 16;

// Log odds (16, pieces, 3) by bit, piece and axis of counts (n, 3). Piece k begins with the step from sample edges[k] to
// the next; nothing changes in a step to a sample after a gap (n,). Of the steps in which a bit may change, a stuck one
// changes in a share of `errors`, and a sound one in `sound` at most.
void stuck_odds(const std::int32_t* counts, const bool* gap, std::size_t n, const std::int64_t* edges,
                std::size_t pieces, double errors, double sound, double* odds);

}  // namespace mpucal
