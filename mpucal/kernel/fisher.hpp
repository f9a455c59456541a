// The Fisher matrix, a sum of outer products of rows: gathered over some steps, then added a tile at a time, so that
// the tile stays in registers.
#pragma once
#include "filter.hpp"
#include "lane.hpp"

namespace mpucal {
namespace {  // each instruction set has its own copy

// Lower triangle of the matrix over this many lanes, filled up to G groups
template <int used>
class Fisher {
  static constexpr int G = groups_of(used);

 public:
  Fisher() {
    for (auto& row : H_)
      for (Lane& lane : row) lane = all(0.0);
  }

  // H += the sum of x' x over the rows x
  void add(const Lane (*rows)[G], int count) {
    for_each<G>([&](auto i) {
      constexpr int height = used - 4 * i < 4 ? used - 4 * i : 4, widest = height == 1 ? 8 : kLanesInATile;
      constexpr int tiles = i / widest + 1;
      for_each<tiles>([&](auto k) {
        constexpr int begin = (i + 1) * k / tiles, end = (i + 1) * (k + 1) / tiles;
        tile<height, end - begin>(rows, count, i, begin);
      });
    });
  }

  void write(double* out) const {
    for (int i = 0; i < 4 * G; ++i)
      for (int j = 0; j <= i; ++j) out[i * 4 * G + j] = out[j * 4 * G + i] = at(H_[i][j / 4], j % 4);
  }

 private:
  template <int height, int width>
  MPUCAL_INLINE void tile(const Lane (*rows)[G], int count, int i, int j) {
    constexpr int abreast = height * width < 8 ? 2 : 1;  // rows: the sums of a small tile would depend on each other
    Lane sum[abreast][height][width];
    for (int a = 0; a < height; ++a)
      for (int b = 0; b < width; ++b) {
        sum[0][a][b] = H_[4 * i + a][j + b];
        if constexpr (abreast > 1) sum[1][a][b] = all(0.0);
      }
    const auto add_row = [&](const Lane (&row)[G], Lane (&to)[height][width]) {
      for (int a = 0; a < height; ++a)
        for (int b = 0; b < width; ++b) to[a][b] = madd(at(row[i], a), row[j + b], to[a][b]);
    };
    int k = 0;
    for (; k + abreast <= count; k += abreast)
      for (int r = 0; r < abreast; ++r) add_row(rows[k + r], sum[r]);
    if (k < count) add_row(rows[k], sum[0]);
    for (int a = 0; a < height; ++a)
      for (int b = 0; b < width; ++b)
        H_[4 * i + a][j + b] = abreast > 1 ? sum[0][a][b] + sum[abreast - 1][a][b] : sum[0][a][b];
  }

  Lane H_[4 * G][G];
};
template <>
class Fisher<0> {};

}  // namespace
}  // namespace mpucal
