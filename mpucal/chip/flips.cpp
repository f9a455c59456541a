// Words of frames that jump and come back: bit_flips.py repairs them.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

#include "../aligned.hpp"

namespace nb = nanobind;

namespace {

using Frames = nb::ndarray<const std::int16_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Ends = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Medians = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Jumps = std::vector<std::pair<std::size_t, std::size_t>>;

constexpr double WITHIN = 6.0, BEYOND = 6.0, FLOOR = 8.0, LEAST_JUMP = 128.0, STEP = 0.05, LEAST_MEDIAN = 1.0;

// The jumps of frames first..last-1 of `run`, each of which has neighbours; the median moves on by all of them.
Jumps jumps(const std::int16_t* run, std::size_t words, std::size_t first, std::size_t last, double* median) {
  Jumps found;
  std::vector<double> steps(words, 0.0);
  for (std::size_t at = first; at < last; ++at) {
    std::size_t jumped = 0, returned = 0, word = 0;
    for (std::size_t w = 0; w < words; ++w) {
      const double before = run[(at - 1) * words + w], here = run[at * words + w], after = run[(at + 1) * words + w];
      const double off = std::fabs(here - (before + after) / 2), near = WITHIN * median[w] + FLOOR;
      steps[w] += (off > median[w]) - (off < median[w]);
      if (off < std::fmax(LEAST_JUMP, BEYOND * near)) continue;
      ++jumped;
      if (std::fabs(after - before) > std::fmax(near, off / 4)) continue;
      ++returned;
      word = w;
    }
    if (jumped == 1 && returned == 1) found.emplace_back(at, word);
  }
  for (std::size_t w = 0; w < words; ++w) median[w] = std::fmax(median[w] * std::exp(STEP * steps[w]), LEAST_MEDIAN);
  return found;
}

std::pair<std::size_t, Jumps> until_jumps(Frames run, Ends ends, Medians median) {
  const std::size_t words = run.shape(1);
  const std::int16_t* const frames = mpucal::aligned(run);
  const std::int64_t* const end = mpucal::aligned(ends);
  double* const medians = mpucal::aligned(median);
  if (median.shape(0) != words) throw std::invalid_argument("there is a median for each word");
  // each frame that is judged has a neighbour on either side
  std::int64_t least = 2;
  for (std::size_t poll = 0; poll < ends.shape(0); ++poll) {
    if (end[poll] < least || end[poll] > static_cast<std::int64_t>(run.shape(0)))
      throw std::invalid_argument("the ends of the polls do not ascend within the frames");
    least = end[poll];
  }
  std::size_t first = 1;
  for (std::size_t poll = 0; poll < ends.shape(0); ++poll) {
    const std::size_t last = static_cast<std::size_t>(end[poll]) - 1;
    const Jumps found = jumps(frames, words, first, last, medians);
    if (!found.empty()) return {poll, found};
    first = last;
  }
  return {ends.shape(0), {}};
}

}  // namespace

NB_MODULE(_flips, m) {
  m.doc() = "Words of frames that jump and come back.";
  m.def("until_jumps", &until_jumps, nb::arg("run"), nb::arg("ends"), nb::arg("median"),
        "(poll, [(frame, word)]) the jumps of the first poll that has any, or the number of polls and none. The polls'"
        " frames end before `ends` (k,) of `run` (n, words); `median` (words,) moves on with each poll.");
}
