// Packed integers of Protocol Buffers to arrays, and back: see protobuf.py.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "../aligned.hpp"

namespace nb = nanobind;

namespace {

using Whole = nb::ndarray<nb::numpy, std::uint64_t, nb::ndim<1>>;
using GivenWhole = nb::ndarray<const std::uint64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Frames = nb::ndarray<nb::numpy, std::int16_t, nb::ndim<2>>;

// a frame has 3 or 7
constexpr std::size_t MOST_WORDS = 1024;

// Calls `take` with each number of `data`; std::invalid_argument (ValueError) where the last is cut, or one too long.
template <class Take>
void each(const nb::bytes& data, Take take) {
  const auto* at = reinterpret_cast<const std::uint8_t*>(data.c_str());
  const auto* const end = at + data.size();
  while (at < end) {
    std::uint64_t value = *at & 127u;
    for (unsigned shift = 7; *at++ & 128u; shift += 7) {
      if (shift > 63) throw std::invalid_argument("a number is longer than 64 bits");
      if (at == end) throw std::invalid_argument("a number is cut");
      value |= static_cast<std::uint64_t>(*at & 127u) << shift;
    }
    take(value);
  }
}

std::size_t count(const nb::bytes& data) {
  const auto* const begin = reinterpret_cast<const std::uint8_t*>(data.c_str());
  return static_cast<std::size_t>(std::count_if(begin, begin + data.size(), [](std::uint8_t b) { return b < 128; }));
}

template <class Number>
nb::capsule owned(std::vector<Number>* values) {
  return nb::capsule(values, [](void* held) noexcept { delete static_cast<std::vector<Number>*>(held); });
}

Whole unpacked(const nb::bytes& data) {
  auto values = std::make_unique<std::vector<std::uint64_t>>();
  values->reserve(count(data));
  each(data, [&](std::uint64_t value) { values->push_back(value); });
  auto* const held = values.release();
  return Whole(held->data(), {held->size()}, owned(held));
}

nb::bytes packed(GivenWhole values) {
  const std::uint64_t* const given = mpucal::aligned(values);
  std::string data;
  data.reserve(2 * values.shape(0));
  for (std::size_t i = 0; i < values.shape(0); ++i) {
    std::uint64_t value = given[i];
    for (; value > 127; value >>= 7) data.push_back(static_cast<char>(value | 128u));
    data.push_back(static_cast<char>(value));
  }
  return nb::bytes(data.data(), data.size());
}

Frames frames(const nb::bytes& data, std::size_t words) {
  if (words == 0 || words > MOST_WORDS) throw std::invalid_argument("a frame of no words, or of too many");
  auto values = std::make_unique<std::vector<std::int16_t>>();
  values->reserve(count(data));
  // of zeros before the first
  std::vector<std::uint16_t> before(words, 0);
  std::size_t word = 0;
  each(data, [&](std::uint64_t value) {
    const auto step = static_cast<std::uint16_t>((value >> 1) ^ (~(value & 1) + 1));
    before[word] = static_cast<std::uint16_t>(before[word] + step);
    values->push_back(static_cast<std::int16_t>(before[word]));
    word = word + 1 == words ? 0 : word + 1;
  });
  if (word != 0) throw std::invalid_argument("a frame is cut");
  auto* const held = values.release();
  return Frames(held->data(), {held->size() / words, words}, owned(held));
}

}  // namespace

NB_MODULE(_packed, m) {
  m.doc() = "Packed integers of Protocol Buffers to arrays, and back.";
  m.def("packed", &packed, nb::arg("values"), "Varints of (n,) numbers, one after the other.");
  m.def("unpacked", &unpacked, nb::arg("data"), "(n,) varints one after the other; ValueError where one is cut.");
  m.def("frames", &frames, nb::arg("data"), nb::arg("words"),
        "(n, words) int16 of zigzag varints, each less the same word of the frame before, modulo 2^16; ValueError where"
        " a number or a frame is cut.");
}
