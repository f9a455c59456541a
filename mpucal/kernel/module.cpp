// Python module of the kernel: NumPy arrays become plain pointers, and the GIL is released while it runs.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include "../aligned.hpp"
#include "bits.hpp"
#include "filter.hpp"
#include "hand.hpp"
#include "runs.hpp"

namespace nb = nanobind;
using namespace mpucal;

namespace {

using Array = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Out = nb::ndarray<nb::numpy, double>;

Evaluate choose() {
#ifdef MPUCAL_AVX2
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return evaluate_avx2;
#endif
  return evaluate_portable;
}

EvaluateHand choose_hand() {
#ifdef MPUCAL_AVX2
  if (choose() == evaluate_avx2) return evaluate_hand_avx2;
#endif
  return evaluate_hand_portable;
}

Evaluate evaluate = choose();
EvaluateHand evaluate_hand = choose_hand();

const double* pointer(const Array& array, std::size_t size, const char* name) {
  if (array.size() != size)
    throw std::invalid_argument(std::string(name) + " holds " + std::to_string(array.size()) + " numbers, not " +
                                std::to_string(size));
  return aligned(array);
}

const double* pointer(const std::optional<Array>& array, std::size_t size, const char* name) {
  return array ? pointer(*array, size, name) : nullptr;
}

Out give(std::vector<double> values, std::initializer_list<std::size_t> shape) {
  auto* owner = new std::vector<double>(std::move(values));
  nb::capsule capsule(owner, [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
  return Out(owner->data(), shape, capsule);
}

Series make_series(const Array& y, const Array& omega, const Array& dt, const std::optional<Array>& r_scale,
                   const std::optional<Array>& q_scale, const std::optional<Array>& q_extra) {
  Series series;
  const std::size_t n = series.n = dt.size();
  series.dt = aligned(dt);
  series.y = pointer(y, 3 * n, "y");
  series.omega = pointer(omega, 3 * n, "omega");
  series.r_scale = pointer(r_scale, n, "r_scale");
  series.q_scale = pointer(q_scale, n, "q_scale");
  series.q_extra = pointer(q_extra, n, "q_extra");
  return series;
}

HandSeries make_hand_series(const Series& common, const std::optional<Array>& rate, const std::optional<Array>& alpha,
                            const std::optional<Array>& r_extra, const std::optional<Array>& jerk,
                            const std::optional<Array>& reset, const std::optional<Array>& force) {
  HandSeries series{common, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr};
  series.rate = pointer(rate, 3 * series.n, "rate");
  series.alpha = pointer(alpha, 3 * series.n, "alpha");
  if (!series.rate != !series.alpha) throw std::invalid_argument("rate and alpha come together");
  series.r_extra = pointer(r_extra, series.n, "r_extra");
  series.jerk = pointer(jerk, series.n, "jerk");
  series.reset = pointer(reset, series.n, "reset");
  series.force = pointer(force, 3 * series.n, "force");
  return series;
}

// A structure of doubles from an array of the same size
template <typename Values>
Values make(const Array& array, const char* name) {
  constexpr std::size_t count = sizeof(Values) / sizeof(double);
  const double* p = pointer(array, count, name);
  Values values;
  std::memcpy(static_cast<void*>(&values), p, sizeof values);
  return values;
}

HandConstants make_hand_constants(const Array& array) {
  const auto constants = make<HandConstants>(array, "constants");
  if (!(constants.lam > 0.0)) throw std::invalid_argument("lam is not positive");
  if (constants.tail != 0.0 && constants.tail != 1.0) throw std::invalid_argument("tail is neither 0 nor 1");
  return constants;
}

using Indices = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

using Runs = nb::ndarray<const std::int64_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// First and last + 1 of each run, which holds `least` of n samples or more
const std::int64_t* within(const Runs& runs, std::size_t n, std::int64_t least) {
  if (runs.shape(1) != 2) throw std::invalid_argument("a run is a first sample and a last + 1");
  for (std::size_t r = 0; r < runs.shape(0); ++r)
    if (runs(r, 0) < 0 || runs(r, 1) < runs(r, 0) + least || static_cast<std::size_t>(runs(r, 1)) > n)
      throw std::invalid_argument("a run is empty, or not within the samples");
  return aligned(runs);
}

// The samples up to which sums are wanted: those given, or the last alone
std::vector<long> make_ends(const std::optional<Indices>& given, std::size_t n) {
  std::vector<long> ends{static_cast<long>(n)};
  if (given) ends.assign(aligned(*given), aligned(*given) + given->size());
  if (!std::is_sorted(ends.begin(), ends.end()) || ends.empty() || ends.front() < 0 || ends.back() != static_cast<long>(n))
    throw std::invalid_argument("ends do not ascend to the number of samples");
  return ends;
}

auto optional(const char* name) { return nb::arg(name).none() = nb::none(); }

template <typename Function>
void without_gil(Function function) {
  const nb::gil_scoped_release release;
  function();
}

void check(int lanes) {
  if (lanes != 0 && lanes != LanesUsed::accel && lanes != LanesUsed::imu)
    throw std::invalid_argument("lanes is 0 or what a model of the exact filter uses");
}

}  // namespace

NB_MODULE(_kernel, m) {
  m.doc() = "Gravity filter: value, gradient and Fisher matrix of V(theta).";
  m.attr("layout") = kLayout;

  m.def(
      "evaluate",
      [](const Array& theta, const Array& constants, int lanes, const Array& y, const Array& omega, const Array& dt,
         const std::optional<Array>& r_scale, const std::optional<Array>& q_scale,
         const std::optional<Array>& q_extra, const std::optional<Indices>& ends) {
        const Series series = make_series(y, omega, dt, r_scale, q_scale, q_extra);
        const auto parameters = make<Parameters>(theta, "theta");
        const auto values = make<Constants>(constants, "constants");
        check(lanes);
        const std::size_t p = 4 * groups_of(lanes);
        const std::vector<long> at = make_ends(ends, series.n);
        const std::size_t k = at.size();
        std::vector<double> gradient(k * p), fisher(k * p * p);
        Result result{};
        result.ends = {at.data(), static_cast<int>(k)};
        result.gradient = gradient.data();
        result.fisher = fisher.data();
        without_gil([&] { evaluate(parameters, series, values, lanes, result); });
        return std::make_tuple(result.V, result.squares, give(std::move(gradient), {k, p}),
                               give(std::move(fisher), {k, p, p}));
      },
      nb::arg("theta"), nb::arg("constants"), nb::arg("lanes"), nb::arg("y"), nb::arg("omega"), nb::arg("dt"),
      optional("r_scale"), optional("q_scale"), optional("q_extra"), optional("ends"),
      "Return V, sum of e' S^-1 e over the samples, gradient and Fisher matrix up to each of `ends`, by default the last sample "
      "(in lane order; empty for lanes = 0).");

  m.def(
      "evaluate_hand",
      [](const Array& theta, const Array& constants, bool derivatives, const Array& y, const Array& omega,
         const Array& dt, const std::optional<Array>& r_scale, const std::optional<Array>& q_scale,
         const std::optional<Array>& q_extra, const std::optional<Array>& rate, const std::optional<Array>& alpha,
         const std::optional<Array>& r_extra, const std::optional<Array>& jerk, const std::optional<Array>& reset,
         const std::optional<Array>& force, const std::optional<Indices>& ends) {
        const HandSeries series = make_hand_series(
            make_series(y, omega, dt, r_scale, q_scale, q_extra), rate, alpha, r_extra, jerk, reset, force);
        const auto parameters = make<HandParameters>(theta, "theta");
        const HandConstants values = make_hand_constants(constants);
        const std::size_t p = derivatives ? 4 * (kHandGroups + (force ? kGroupsOfS : 0)) : 0;
        const std::vector<long> at = make_ends(ends, series.n);
        const std::size_t k = at.size();
        std::vector<double> gradient(k * p), fisher(k * p * p);
        HandResult result{};
        result.ends = {at.data(), static_cast<int>(k)};
        if (derivatives) {
          result.gradient = gradient.data();
          result.fisher = fisher.data();
        }
        without_gil([&] { evaluate_hand(parameters, series, values, result); });
        return std::make_tuple(result.V, result.squares, give(std::move(gradient), {k, p}),
                               give(std::move(fisher), {k, p, p}));
      },
      nb::arg("theta"), nb::arg("constants"), nb::arg("derivatives"), nb::arg("y"), nb::arg("omega"), nb::arg("dt"),
      optional("r_scale"), optional("q_scale"), optional("q_extra"), optional("rate"), optional("alpha"),
      optional("r_extra"), optional("jerk"), optional("reset"), optional("force"), optional("ends"),
      "Return V, sum of squared whitened innovations, gradient and Fisher matrix of the hand's filter up to each of `ends` "
      "(in lane order; with force, groups for the columns of S follow).");

  m.def(
      "trace_hand",
      [](const Array& theta, const Array& constants, const Array& y, const Array& omega, const Array& dt,
         const std::optional<Array>& r_scale, const std::optional<Array>& q_scale,
         const std::optional<Array>& q_extra, const std::optional<Array>& rate, const std::optional<Array>& alpha,
         const std::optional<Array>& r_extra, const std::optional<Array>& jerk, const std::optional<Array>& reset,
         const std::optional<Array>& force) {
        const HandSeries series = make_hand_series(
            make_series(y, omega, dt, r_scale, q_scale, q_extra), rate, alpha, r_extra, jerk, reset, force);
        const auto parameters = make<HandParameters>(theta, "theta");
        const HandConstants values = make_hand_constants(constants);
        std::vector<double> innovation(3 * series.n), gravity(3 * series.n);
        HandResult result{};
        result.innovation = innovation.data();
        result.gravity = gravity.data();
        without_gil([&] { evaluate_hand(parameters, series, values, result); });
        const std::size_t n = series.n;
        return std::make_tuple(give(std::move(innovation), {n, 3}), give(std::move(gravity), {n, 3}));
      },
      nb::arg("theta"), nb::arg("constants"), nb::arg("y"), nb::arg("omega"), nb::arg("dt"), optional("r_scale"),
      optional("q_scale"), optional("q_extra"), optional("rate"), optional("alpha"), optional("r_extra"),
      optional("jerk"), optional("reset"), optional("force"),
      "Return whitened innovations and predicted gravity, (n, 3) each, of the hand's filter.");

  m.def(
      "moments",
      [](const Array& b_omega, const Array& y, const Array& omega, const Array& dt,
         const std::optional<Array>& r_scale) {
        const Series series = make_series(y, omega, dt, r_scale, {}, {});
        const double* bias = pointer(b_omega, 3, "b_omega");
        Moments sums;
        without_gil([&] { moments(series, bias, sums); });
        auto copy = [](const double* p, std::size_t n) { return std::vector<double>(p, p + n); };
        return std::make_tuple(give(copy(&sums.CC[0][0], 81), {9, 9}), give(copy(&sums.yC[0][0], 27), {3, 9}),
                               give(copy(sums.C, 9), {9}), give(copy(sums.y, 3), {3}), sums.yy, sums.n);
      },
      nb::arg("b_omega"), nb::arg("y"), nb::arg("omega"), nb::arg("dt"), optional("r_scale"),
      "Return sums of C C', y C', C, y, y y and the count, C_t the rotation since the start.");

  m.def(
      "turn",
      [](const Array& phi, const Runs& runs, const std::optional<Array>& x) {
        const std::size_t n = phi.size() / 3, k = runs.shape(0);
        const std::int64_t* const ends = within(runs, n, 0);
        std::vector<double> F(9 * k), sums(27 * k);
        turn(pointer(phi, 3 * n, "phi"), pointer(x, 3 * n, "x"), ends, k, F.data(), sums.data());
        return std::make_tuple(give(std::move(F), {k, 3, 3}), give(std::move(sums), {k, 3, 3, 3}));
      },
      nb::arg("phi"), nb::arg("runs"), optional("x"),
      "Return the rotation of steps phi (n, 3) in each run (k, 2), first and last + 1, and sums of unit vectors times "
      "x (n, 3), rotated from each step to the end.");

  m.def(
      "lengths",
      [](const Array& vectors) {
        const std::size_t n = vectors.size() / 3;
        std::vector<double> length(n);
        lengths(pointer(vectors, 3 * n, "vectors"), n, length.data());
        return give(std::move(length), {n});
      },
      nb::arg("vectors"), "Return the lengths (n,) of vectors (n, 3).");

  m.def(
      "statistics",
      [](const Array& x, const Runs& runs) {
        const std::size_t k = runs.shape(0);
        const std::int64_t* const ends = within(runs, x.size() / 3, 1);
        std::vector<double> mean(3 * k), variance(3 * k);
        statistics(aligned(x), ends, k, mean.data(), variance.data());
        return std::make_tuple(give(std::move(mean), {k, 3}), give(std::move(variance), {k, 3}));
      },
      nb::arg("x"), nb::arg("runs"),
      "Return means and variances (k, 3) of x (n, 3) over runs (k, 2), first and last + 1.");

  m.def(
      "moving_mean",
      [](const nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>& x, std::size_t half) {
        std::vector<double> mean(x.size());
        moving_mean(aligned(x), x.shape(0), x.shape(1), half, mean.data());
        return give(std::move(mean), {x.shape(0), x.shape(1)});
      },
      nb::arg("x"), nb::arg("half"), "Return means of x (n, m) over up to `half` samples on both sides of each.");

  m.def(
      "moving_statistics",
      [](const Array& x, std::size_t size) {
        const std::size_t n = x.size() / 3;
        pointer(x, 3 * n, "x");
        if (size < 1 || size > n) throw std::invalid_argument("a window is empty, or longer than the samples");
        std::vector<double> mean(3 * (n - size + 1)), variance(mean.size());
        moving_statistics(aligned(x), n, size, mean.data(), variance.data());
        return std::make_tuple(give(std::move(mean), {3, n - size + 1}), give(std::move(variance), {3, n - size + 1}));
      },
      nb::arg("x"), nb::arg("size"),
      "Return means and variances (3, n - size + 1) of x (n, 3) over all windows of `size` samples.");

  m.def(
      "noise_variance",
      [](const Array& x, std::size_t half) {
        const std::size_t n = x.size() / 3;
        std::vector<double> variance(3 * n);
        noise_variance(pointer(x, 3 * n, "x"), n, half, variance.data());
        return give(std::move(variance), {n, 3});
      },
      nb::arg("x"), nb::arg("half"),
      "Return variances (n, 3) of the noise of x (n, 3), by fourth differences over up to `half` samples on both sides.");

  m.def(
      "squared_differences",
      [](const nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>& x, std::size_t fresh,
         const Indices& spans) {
        const std::size_t rows = x.shape(0), n = x.shape(1), count = spans.size();
        std::vector<std::size_t> m(aligned(spans), aligned(spans) + count);
        for (std::size_t i = 0; i < count; ++i)
          if (m[i] == 0 || m[i] & (m[i] - 1) || (i && m[i] <= m[i - 1]) || m[i] > 1 << 20)
            throw std::invalid_argument("spans are not ascending powers of two up to 2^20");
        std::vector<double> squares(rows * count);
        for (std::size_t row = 0; row < rows && count; ++row)
          squared_differences(aligned(x) + row * n, n, fresh, m, squares.data() + row * count);
        return give(std::move(squares), {rows, count});
      },
      nb::arg("x"), nb::arg("fresh"), nb::arg("spans"),
      "Return sums (rows, k) of squares, by which sums over spans (k,) of x (rows, n) differ from those before.");

  m.def(
      "mean_rates",
      [](const Array& rate, const Array& bias, const Array& dt) {
        const std::size_t n = dt.size(), samples = rate.size() / 3;
        pointer(rate, 3 * samples, "rate");
        if (samples <= n) throw std::invalid_argument("there are no rates before the steps");
        std::vector<double> mean(3 * n);
        mean_rates(aligned(rate), samples, pointer(bias, 3, "bias"), aligned(dt), n, mean.data());
        return give(std::move(mean), {n, 3});
      },
      nb::arg("rate"), nb::arg("bias"), nb::arg("dt"),
      "Return rotation vectors divided by their times (n, 3) of the steps to the last n rates; the bias stays in.");

  m.def(
      "spikes",
      [](const Array& acc, const Array& rate) {
        const std::size_t n = rate.size() / 3;
        std::vector<double> found = spikes(pointer(acc, 3 * n, "acc"), pointer(rate, 3 * n, "rate"), n);
        const std::size_t count = found.size() / 2;
        return give(std::move(found), {count, 2});
      },
      nb::arg("acc"), nb::arg("rate"),
      "Return sample and axis (k, 2) of the spikes of rates (n, 3) beside accelerations (n, 3).");

  m.def(
      "stuck_odds",
      [](const nb::ndarray<const std::int32_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>& counts,
         const nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>& gap,
         const nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>& edges, double errors,
         double sound) {
        const std::size_t n = counts.shape(0), k = edges.size();
        if (counts.shape(1) != 3 || gap.size() != n || n < 1)
          throw std::invalid_argument("counts are (n, 3), gap is (n,)");
        for (std::size_t i = 0; i < k; ++i)
          if (edges(i) < (i ? edges(i - 1) : 0) || static_cast<std::size_t>(edges(i)) >= n)
            throw std::invalid_argument("edges rise within the samples");
        std::vector<double> odds(kBits * k * 3);
        stuck_odds(aligned(counts), gap.data(), n, aligned(edges), k, errors, sound, odds.data());
        return give(std::move(odds), {kBits, k, 3});
      },
      nb::arg("counts"), nb::arg("gap"), nb::arg("edges"), nb::arg("errors"), nb::arg("sound"),
      "Return log odds (16, k, 3) that bits of counts (n, 3) are stuck, in pieces of steps from `edges` (k,) on.");

  m.def("instruction_set", []() -> std::string { return evaluate == evaluate_portable ? "portable" : "avx2"; },
        "Return the build of the filter in use, portable or avx2.");
  m.def(
      "use_instruction_set",
      [](const std::string& name) {
        if (name == "portable")
          evaluate = evaluate_portable, evaluate_hand = evaluate_hand_portable;
        else if (name == "best")
          evaluate = choose(), evaluate_hand = choose_hand();
        else
          throw std::invalid_argument("the instruction set is portable or best");
      },
      nb::arg("name"), "Choose the build of the filter, portable or best; for comparing them.");
}
