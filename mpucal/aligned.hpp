// The numbers of an array that Python gave: nanobind takes them wherever they lie, processors do not.
#pragma once
#include <cstdint>
#include <stdexcept>

namespace mpucal {

template <typename Array>
auto aligned(const Array& array) {
  auto* const data = array.data();
  if (reinterpret_cast<std::uintptr_t>(data) % alignof(decltype(*data)))
    throw std::invalid_argument("the numbers of an array are not aligned: give a copy of it");
  return data;
}

}  // namespace mpucal
