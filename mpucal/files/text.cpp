// Tables of numbers as text, both ways, at the speed of a disk: lines of numbers with commas between them.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "../aligned.hpp"

namespace nb = nanobind;

namespace {

using Table = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Out = nb::ndarray<nb::numpy, double, nb::ndim<2>>;

// The longest double without an exponent, within the bounds below: a sign, "0.0000", and 17 digits.
constexpr std::size_t WIDEST = 32;

#ifdef __cpp_lib_to_chars

using Apart = nb::gil_scoped_release;
constexpr double LEAST_PLAIN = 1e-5, MOST_PLAIN = 1e15;

// In as few digits as give the same number back; without an exponent where a person would write none.
char* put(char* at, double value) {
  const double size = std::fabs(value);
  const bool plain = size == 0.0 || (size >= LEAST_PLAIN && size < MOST_PLAIN);
  return (plain ? std::to_chars(at, at + WIDEST, value, std::chars_format::fixed)
                : std::to_chars(at, at + WIDEST, value)).ptr;
}

bool is_number(const char* begin, const char* end, double& value) {
  const auto [stopped, error] = std::from_chars(begin, end, value);
  return error == std::errc() && stopped == end;
}

#else  // GCC before 11, and libc++: Python's own, which is slower and wants its lock

struct Apart {
  ~Apart() {}
};

char* put(char* at, double value) {
  const std::unique_ptr<char, void (*)(void*)> text(PyOS_double_to_string(value, 'r', 0, 0, nullptr), PyMem_Free);
  if (!text) throw nb::python_error();
  return std::copy_n(text.get(), std::strlen(text.get()), at);
}

bool is_number(const char* begin, const char* end, double& value) {
  if (begin < end && *begin == '+') return false;  // as std::from_chars
  const std::string text(begin, end);
  value = PyOS_string_to_double(text.c_str(), nullptr, nullptr);
  const bool is_one = !PyErr_Occurred();
  PyErr_Clear();
  return is_one;
}

#endif

nb::bytes lines(const Table& table) {
  const std::size_t rows = table.shape(0), columns = table.shape(1);
  const double* value = mpucal::aligned(table);
  std::vector<char> text(rows * columns * (WIDEST + 1));
  char* at = text.data();
  {
    const Apart apart;
    for (std::size_t i = 0; i < rows * columns; ++i) {
      at = put(at, value[i]);
      *at++ = (i + 1) % columns ? ',' : '\n';
    }
  }
  return nb::bytes(text.data(), static_cast<std::size_t>(at - text.data()));
}

constexpr bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

// The number between two commas; false where it is none, or is written as only Python reads it.
bool take(const char* begin, const char* end, double& value) {
  while (begin < end && is_blank(*begin)) ++begin;
  while (begin < end && is_blank(end[-1])) --end;
  return is_number(begin, end, value);
}

// One line's cells at `places` into `row`; false where it is no plain line of `width` cells.
bool take_line(std::string_view line, std::size_t width, const std::vector<std::size_t>& places, double* row,
               std::vector<const char*>& cells) {
  cells.clear();
  cells.push_back(line.data());
  for (const char& c : line) {
    if (c == '"') return false;
    if (c == ',') cells.push_back(&c + 1);
  }
  if (cells.size() != width) return false;
  cells.push_back(line.data() + line.size() + 1);
  for (std::size_t k = 0; k < places.size(); ++k)
    if (!take(cells[places[k]], cells[places[k] + 1] - 1, row[k])) return false;
  return true;
}

std::optional<Out> numbers(nb::bytes data, std::size_t width, const std::vector<std::size_t>& places) {
  const auto outside = [&](std::size_t place) { return place >= width; };
  if (places.empty() || std::any_of(places.begin(), places.end(), outside))
    throw std::invalid_argument("places must name cells of a line, 0 to width - 1, and at least one");
  const std::string_view text(data.c_str(), data.size());
  auto values = std::make_unique<std::vector<double>>();
  bool plain = true;
  {
    const Apart apart;
    std::vector<const char*> cells;
    for (std::size_t at = 0; plain && at < text.size();) {
      const std::size_t end = std::min(text.find('\n', at), text.size());
      const std::string_view line = text.substr(at, end - at);
      at = end + 1;
      if (line.find_first_not_of(" \t\r") == std::string_view::npos) continue;
      values->resize(values->size() + places.size());
      plain = take_line(line, width, places, values->data() + values->size() - places.size(), cells);
    }
  }
  if (!plain) return std::nullopt;
  const std::size_t rows = values->size() / places.size();
  double* first = values->data();
  nb::capsule owner(values.release(), [](void* held) noexcept { delete static_cast<std::vector<double>*>(held); });
  return Out(first, {rows, places.size()}, owner);
}

}  // namespace

NB_MODULE(_text, m) {
  m.doc() = "Tables of numbers as text, both ways.";
  m.def("lines", &lines, nb::arg("table"), "(n, k) as n lines of text, each number in as few digits as give it back.");
  m.def("numbers", &numbers, nb::arg("text"), nb::arg("width"), nb::arg("places"),
        "(n, k) of the cells at `places` of lines of `width` cells, empty lines left out; None where a line has"
        " another number of cells, a quotation mark, or what is no plain number.");
}
