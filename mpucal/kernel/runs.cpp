// See runs.hpp.
#include "runs.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <vector>

#include "rotation.hpp"

namespace mpucal {
namespace {

// Of the second difference of rates: 1/24 for samples of a smooth rate, 1/16 for its means over the sample's time. The
// low-pass filter of a chip is in between.
constexpr double kChord = 0.05;

// A fourth difference has the coefficients 1, -4, 6, -4, 1, whose squares have this sum.
constexpr double kSquares = 70.0;

// A spike exceeds this much, and this many times the departures of its neighbours from theirs; its neighbours differ by less
// than this share of it.
constexpr double kLeastSpike[2] = {0.3, 0.15}, kSpikes = 8.0, kReturns = 0.25;  // m/s^2, rad/s

double square(double x) { return x * x; }

// M = F M, column by column
template <std::size_t columns>
void carry(const double (&F)[3][3], double (&M)[3][columns]) {
  for (std::size_t c = 0; c < columns; ++c) {
    const double x = M[0][c], y = M[1][c], z = M[2][c];
    for (int i = 0; i < 3; ++i) M[i][c] = F[i][0] * x + F[i][1] * y + F[i][2] * z;
  }
}

}  // namespace

void turn(const double* phi, const double* x, const std::int64_t* runs, std::size_t count, double* F, double* sums) {
  for (std::size_t r = 0; r < count; ++r, F += 9, sums += 27) {
    double turned[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, entered[3][9] = {};
    for (std::int64_t i = runs[2 * r]; i < runs[2 * r + 1]; ++i) {
      Turn<double> step;
      std::copy_n(phi + 3 * i, 3, step.phi);
      step.compute();
      carry(step.F, turned);
      if (!x) continue;
      for (int j = 0; j < 3; ++j)
        for (int k = 0; k < 3; ++k) entered[j][3 * j + k] += x[3 * i + k];
      carry(step.F, entered);
    }
    std::memcpy(F, turned, sizeof turned);
    std::memcpy(sums, entered, sizeof entered);
  }
}

void lengths(const double* vectors, std::size_t n, double* length) {
  for (std::size_t i = 0; i < n; ++i, vectors += 3)
    length[i] = std::sqrt(vectors[0] * vectors[0] + vectors[1] * vectors[1] + vectors[2] * vectors[2]);
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
  const auto over = [&](std::size_t i) {
    const std::size_t low = i > half ? i - half : 0, high = half < n - i ? i + half + 1 : n;
    for (std::size_t j = columns * i; j < columns * (i + 1); ++j)
      mean[j] = (sums[j + columns * (high - i)] - sums[j - columns * (i - low)]) / static_cast<double>(high - low);
  };
  const std::size_t begin = std::min(half, n), end = std::max(begin, n - begin);
  for (std::size_t i = 0; i < begin; ++i) over(i);
  // Between the ends all means are over as many samples, which a compiler turns into vectors.
  const double* const sum = sums.data();
  const auto count = static_cast<double>(2 * half + 1);
  for (std::size_t j = columns * begin; j < columns * end; ++j)
    mean[j] = (sum[j + columns * (half + 1)] - sum[j - columns * half]) / count;
  for (std::size_t i = end; i < n; ++i) over(i);
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

void noise_variance(const double* x, std::size_t n, std::size_t half, double* variance) {
  std::vector<double> squares(3 * n);
  for (std::size_t i = 0; i + 12 < 3 * n; ++i) {
    const double d = x[i] + x[i + 12] - 4.0 * (x[i + 3] + x[i + 9]) + 6.0 * x[i + 6];
    squares[i + 6] = d * d / kSquares;
  }
  moving_mean(squares.data(), n, 3, half, variance);
}

void squared_differences(const double* x, std::size_t n, std::size_t fresh, const std::vector<std::size_t>& spans,
                         double* squares) {
  // Sums side by side, which a compiler turns into vectors, and as many new elements at a time as stay in the cache.
  constexpr std::size_t kLanes = 8, kPart = 1024;
  const std::size_t before = 2 * spans.back() - 1;
  std::vector<double> sums(std::min(before + kPart, n));
  for (std::size_t first = n - std::min(fresh, n), last; first < n; first = last) {
    last = std::min(first + kPart, n);
    const std::size_t begin = first > before ? first - before : 0, size = last - begin;
    std::copy(x + begin, x + last, sums.begin());
    auto span = spans.begin();
    for (std::size_t m = 1; span != spans.end() && 2 * m <= size; m *= 2) {
      if (m == *span) {
        const std::size_t count = std::min(last - first, size - 2 * m + 1);
        const double *const later = sums.data() + (size - m + 1 - count), *const earlier = later - m;
        double lanes[kLanes] = {};
        for (std::size_t i = 0; i < count / kLanes * kLanes; i += kLanes)
          for (std::size_t l = 0; l < kLanes; ++l) lanes[l] += square(later[i + l] - earlier[i + l]);
        for (std::size_t i = count / kLanes * kLanes; i < count; ++i) lanes[0] += square(later[i] - earlier[i]);
        squares[span++ - spans.begin()] += std::accumulate(lanes, lanes + kLanes, 0.0);
      }
      for (std::size_t i = 0; i + 2 * m <= size; ++i) sums[i] += sums[i + m];
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

std::vector<double> spikes(const double* acc, const double* rate, std::size_t n) {
  const auto bent = [&](std::size_t i, int j) {  // twice the departure of the sample after i from its neighbours
    const double* const x = rate + 3 * i + j;
    return std::fabs((x[6] - x[3]) - (x[3] - x[0]));
  };
  std::vector<double> found;
  for (std::size_t i = 0; i + 2 < n; ++i) {
    bool is_bent = false, is_sudden = i < 2;
    for (int j = 0; j < 3; ++j) is_bent |= bent(i, j) > 2.0 * kLeastSpike[1];
    if (!is_bent) continue;
    for (int j = 0; j < 3 && !is_sudden; ++j) is_sudden = bent(i, j) > kSpikes * bent(i - 2, j);
    if (!is_sudden) continue;
    int jumps = 0, spike = -1;
    for (int word = 0; word < 6; ++word) {
      const double* const x = (word < 3 ? acc : rate) + word % 3;
      const auto off = [&](std::size_t at) {
        return std::fabs(x[3 * at] - 0.5 * (x[3 * at - 3] + x[3 * at + 3]));
      };
      const double size = off(i + 1);
      bool jumped = size > kLeastSpike[word / 3];
      // The departures of the samples beside it hold half of the spike: those beyond them do not.
      for (const int beside : {-2, -1, 3, 4}) {
        const auto at = static_cast<std::ptrdiff_t>(i) + beside;
        if (at > 0 && at + 1 < static_cast<std::ptrdiff_t>(n))
          jumped = jumped && size > kSpikes * off(static_cast<std::size_t>(at));
      }
      jumps += jumped;
      if (jumped && word >= 3 && std::fabs(x[3 * i + 6] - x[3 * i]) < kReturns * size) spike = word - 3;
    }
    if (jumps == 1 && spike >= 0) found.insert(found.end(), {static_cast<double>(i + 1), static_cast<double>(spike)});
  }
  return found;
}

}  // namespace mpucal
