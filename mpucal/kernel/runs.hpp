// Functions of runs of samples without a filter: products of rotations, lengths, means and variances, moving ones, mean
// rates, noise, differences of sums, spikes.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace mpucal {

// F (runs, 3, 3) = exp([phi_last-1]x) ... exp([phi_first]x) of steps phi (n, 3) [rad] in each run, the identity of none.
// Where x (n, 3) is given, sums[j][k] (3,) of (runs, 3, 3, 3), row, then j and k, is the sum of F_last-1 ... F_i e_j x_i[k]:
// vectors that enter on the way, rotated to the end. Without x it is 0.
void turn(const double* phi, const double* x, const std::int64_t* runs, std::size_t count, double* F, double* sums);

// Lengths (n,) of vectors (n, 3).
void lengths(const double* vectors, std::size_t n, double* length);

// Means and variances (runs, 3) of x (n, 3) over samples first..last-1 of each run.
void statistics(const double* x, const std::int64_t* runs, std::size_t count, double* mean, double* variance);

// Means (n, columns) of x (n, columns) over samples i - half..i + half, as far as they exist.
void moving_mean(const double* x, std::size_t n, std::size_t columns, std::size_t half, double* mean);

// Means and variances (3, n - size + 1) of x (n, 3) over all windows of `size` samples.
void moving_statistics(const double* x, std::size_t n, std::size_t size, double* mean, double* variance);

// Fourth differences of x (n, 3), squared, as variances (n, 3) of white noise: moving means as those above.
void noise_variance(const double* x, std::size_t n, std::size_t half, double* variance);

// For each span of m elements of x (n,), of powers of two that ascend: the sum of the squares by which the sum over m
// differs from the sum over the m before, of those that end with the last `fresh` elements; added to squares (spans,).
void squared_differences(const double* x, std::size_t n, std::size_t fresh, const std::vector<std::size_t>& spans,
                         double* squares);

// The rotation vectors (n, 3) of the steps that lead to the last n of `samples` rates [rad/s], each over its time dt.
void mean_rates(const double* rate, std::size_t samples, const double bias[3], const double* dt, std::size_t n,
                double* mean);

// The spikes of rates (n, 3) [rad/s] beside accelerations (n, 3) [m/s^2]: sample and axis, one after the other. A spike
// is back with the next sample, alone among the six words, and far beyond its neighbours' departures from theirs.
std::vector<double> spikes(const double* acc, const double* rate, std::size_t n);

}  // namespace mpucal
