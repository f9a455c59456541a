// See runs.hpp.
#include "runs.hpp"

#include <algorithm>
#include <cstring>
#include <vector>

#include "rotation.hpp"

namespace mpucal {
namespace {

// Of the second difference of rates: 1/24 for samples of a smooth rate, 1/16 for its means over the sample's time. The
// low-pass filter of a chip is in between.
constexpr double kChord = 0.05;

// M = F M, column by column
template <std::size_t columns>
void carry(const double (&F)[3][3], double (&M)[3][columns]) {
  for (std::size_t c = 0; c < columns; ++c) {
    const double x = M[0][c], y = M[1][c], z = M[2][c];
    for (int i = 0; i < 3; ++i) M[i][c] = F[i][0] * x + F[i][1] * y + F[i][2] * z;
  }
}

}  // namespace

void turn(const double* phi, const double* x, std::size_t n, Turned& out) {
  out = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {}};
  double sums[3][9] = {};
  for (std::size_t i = 0; i < n; ++i) {
    Turn<double> step;
    std::copy_n(phi + 3 * i, 3, step.phi);
    step.compute();
    carry(step.F, out.F);
    if (!x) continue;
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) sums[j][3 * j + k] += x[3 * i + k];
    carry(step.F, sums);
  }
  std::memcpy(out.sums, sums, sizeof sums);
}

void statistics(const double* x, const std::int64_t* runs, std::size_t count, double* mean, double* variance) {
  for (std::size_t r = 0; r < count; ++r, mean += 3, variance += 3) {
    const double *first = x + 3 * runs[2 * r], *last = x + 3 * runs[2 * r + 1];
    const auto n = static_cast<double>((last - first) / 3);
    double sum[3] = {}, squares[3] = {};
    for (const double* p = first; p < last; p += 3)
      for (int j = 0; j < 3; ++j) sum[j] += p[j];
    for (int j = 0; j < 3; ++j) mean[j] = sum[j] / n;
    for (const double* p = first; p < last; p += 3)
      for (int j = 0; j < 3; ++j) squares[j] += (p[j] - mean[j]) * (p[j] - mean[j]);
    for (int j = 0; j < 3; ++j) variance[j] = squares[j] / n;
  }
}

void moving_mean(const double* x, std::size_t n, std::size_t columns, std::size_t half, double* mean) {
  if (n == 0) return;
  std::vector<double> sums(columns * (n + 1));
  for (std::size_t i = 0; i < columns * n; ++i) sums[i + columns] = sums[i] + x[i];
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t low = i > half ? i - half : 0, high = half < n - i ? i + half + 1 : n;
    for (std::size_t j = 0; j < columns; ++j)
      mean[columns * i + j] = (sums[columns * high + j] - sums[columns * low + j]) / static_cast<double>(high - low);
  }
}

void moving_statistics(const double* x, std::size_t n, std::size_t size, double* mean, double* variance) {
  const std::size_t windows = n - size + 1;
  for (int j = 0; j < 3; ++j, mean += windows, variance += windows) {
    const auto from_first = [&](std::size_t i) { return x[3 * i + j] - x[j]; };  // less cancellation in squares
    double sum = 0.0, squares = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const double in = from_first(i), out = i < size ? 0.0 : from_first(i - size);
      sum += in - out;
      squares += in * in - out * out;
      if (i + 1 < size) continue;
      const double middle = sum / static_cast<double>(size);
      mean[i + 1 - size] = middle + x[j];
      variance[i + 1 - size] = std::max(squares / static_cast<double>(size) - middle * middle, 0.0);
    }
  }
}

void mean_rates(const double* rate, std::size_t samples, const double bias[3], const double* dt, std::size_t n,
                double* mean) {
  for (std::size_t i = samples - n; i < samples; ++i, ++dt) {
    const double *here = rate + 3 * (i - 1), *there = here + 3;
    const double *before = i > 1 ? here - 3 : here, *after = i + 1 < samples ? there + 3 : there;
    double w[3], v[3];
    for (int j = 0; j < 3; ++j) w[j] = here[j] - bias[j], v[j] = there[j] - bias[j];
    for (int j = 0; j < 3; ++j) {
      const int k = (j + 1) % 3, l = (j + 2) % 3;
      const double bend = before[j] - here[j] - there[j] + after[j], coning = *dt / 12.0 * (w[k] * v[l] - w[l] * v[k]);
      *mean++ = 0.5 * (here[j] + there[j]) - kChord * bend + coning;
    }
  }
}

}  // namespace mpucal
