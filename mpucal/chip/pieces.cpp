// Best break of a straight line: piecewise_rate.py decides whether it is one.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>

#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <tuple>
#include <vector>

#include "../aligned.hpp"

namespace nb = nanobind;

namespace {

using Points = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// Sums of squares about the line through points 0..k, for every k.
class LeftOver {
 public:
  double next(double t, double y) {
    ++k_;
    st_ += t;
    sy_ += y;
    tt_ += t * t;
    ty_ += t * y;
    yy_ += y * y;
    const double stt = tt_ - st_ * st_ / k_, sty = ty_ - st_ * sy_ / k_, syy = yy_ - sy_ * sy_ / k_;
    return std::fmax(stt > 0 ? syy - sty * sty / stt : syy, 0.0);
  }

 private:
  double k_ = 0, st_ = 0, sy_ = 0, tt_ = 0, ty_ = 0, yy_ = 0;
};

// Returns (at, of both, of one): the first point of the second of the two lines that leave least, what these leave, and what
// one line leaves; at -1 where no place has `least` points and `least_s` on either side.
std::tuple<std::ptrdiff_t, double, double> best_break(const Points& times, const Points& values, std::ptrdiff_t least,
                                                      double least_s) {
  const auto n = static_cast<std::ptrdiff_t>(times.shape(0));
  const double *const t = mpucal::aligned(times), *const y = mpucal::aligned(values);
  if (values.shape(0) != times.shape(0)) throw std::invalid_argument("t and y have different lengths");
  if (least < 1) throw std::invalid_argument("a line has one point or more");
  std::vector<double> after(static_cast<std::size_t>(n));
  LeftOver backwards, forwards;
  for (std::ptrdiff_t i = n; i-- > 0;) after[static_cast<std::size_t>(i)] = backwards.next(t[i], y[i]);
  std::ptrdiff_t best = -1;
  double both = 0.0, one = 0.0;
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    const std::ptrdiff_t at = i + 1;  // `one` is of the points before it
    one = forwards.next(t[i], y[i]);
    if (at < least || at > n - least || !(t[at - 1] - t[0] >= least_s) || !(t[n - 1] - t[at] >= least_s)) continue;
    const double left = one + after[static_cast<std::size_t>(at)];
    if (best < 0 || left < both) best = at, both = left;
  }
  return {best, both, one};
}

}  // namespace

NB_MODULE(_pieces, m) {
  m.doc() = "Where a straight line breaks best.";
  m.def("best_break", &best_break, nb::arg("t"), nb::arg("y"), nb::arg("least"), nb::arg("least_s"),
        "(at, of both, of one): the first point of the second of the two lines that leave the least squares of (n,) `y`"
        " over `t`, what they leave, and what one line leaves; at -1 where no place has `least` points and `least_s` on"
        " either side.");
}
