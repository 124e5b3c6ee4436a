// Boxes in the cells of a grid: which of them may meet another box.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace dccd {

class BoxGrid {
 public:
  /// Of `count` boxes; boxOf(i) has `lo` and `hi`, indexed by axis, of finite numbers. Cells are this wide, or wider
  /// where there would be too many of them, or too many of them would list a box.
  template <class BoxOf>
  void build(std::size_t count, double cell_m, BoxOf boxOf) {
    lo_.fill(1e300);
    hi_.fill(-1e300);
    for (std::size_t i = 0; i < count; ++i) {
      const auto& box = boxOf(i);
      for (int a = 0; a < 3; ++a) {
        lo_[a] = std::min(lo_[a], box.lo[a]);
        hi_[a] = std::max(hi_[a], box.hi[a]);
      }
    }
    first_.clear();
    listed_.clear();
    if (count == 0) return;
    const double most = 64.0 * static_cast<double>(count) + 4096;
    for (;; cell_m *= 2) {
      double cells = 1;
      for (int a = 0; a < 3; ++a) cells *= std::floor((hi_[a] - lo_[a]) / cell_m) + 1;
      double listed = cells > most ? most + 1 : 0;
      for (std::size_t i = 0; i < count && listed <= most; ++i) {
        const auto& box = boxOf(i);
        double its = 1;
        for (int a = 0; a < 3; ++a) its *= std::min((box.hi[a] - box.lo[a]) / cell_m + 2, cells);
        listed += its;
      }
      if (listed <= most || cells == 1) break;
    }
    inverse_cell_ = 1 / cell_m;
    for (int a = 0; a < 3; ++a) cells_[a] = static_cast<std::int64_t>((hi_[a] - lo_[a]) * inverse_cell_) + 1;
    first_.assign(static_cast<std::size_t>(cells_[0] * cells_[1] * cells_[2]) + 1, 0);
    const auto forEachCell = [&](auto&& take) {
      for (std::size_t i = 0; i < count; ++i) {
        const auto& box = boxOf(i);
        anyCell(&box.lo[0], &box.hi[0], [&](std::size_t cell) {
          take(i, cell);
          return false;
        });
      }
    };
    forEachCell([&](std::size_t, std::size_t cell) { ++first_[cell + 1]; });
    for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
    listed_.resize(first_.back());
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    forEachCell([&](std::size_t i, std::size_t cell) { listed_[next[cell]++] = static_cast<std::uint32_t>(i); });
  }

  /// Whether the box that is around all of them meets this closed one.
  bool meets(const double* lo, const double* hi) const {
    for (int a = 0; a < 3; ++a) {
      if (!(hi[a] >= lo_[a] && lo[a] <= hi_[a])) return false;
    }
    return true;
  }

  /// Whether test(i) is true of one of the boxes that meet this closed one, and maybe of some more. It may be asked
  /// more than once of a box, and is not asked on once it was true.
  template <class Test>
  bool any(const double* lo, const double* hi, Test&& test) const {
    return !first_.empty() && anyCell(lo, hi, [&](std::size_t cell) {
      for (std::uint32_t i = first_[cell]; i < first_[cell + 1]; ++i) {
        if (test(listed_[i])) return true;
      }
      return false;
    });
  }
  /// Calls visit(i) for at least the boxes that meet this closed one; for some more than once.
  template <class Visit>
  void visit(const double* lo, const double* hi, Visit&& visit) const {
    any(lo, hi, [&](std::uint32_t i) {
      visit(i);
      return false;
    });
  }

 private:
  std::array<double, 3> lo_{}, hi_{};
  std::array<std::int64_t, 3> cells_{};
  double inverse_cell_ = 0;
  std::vector<std::uint32_t> first_, listed_;  // per cell its first place in the list; numbers of boxes

  std::int64_t cellOf(double x, int a) const {
    return static_cast<std::int64_t>(std::clamp((x - lo_[a]) * inverse_cell_, 0.0, static_cast<double>(cells_[a] - 1)));
  }
  template <class Test>
  bool anyCell(const double* lo, const double* hi, const Test& test) const {
    if (!meets(lo, hi)) return false;
    std::array<std::int64_t, 3> low, high;
    for (int a = 0; a < 3; ++a) {
      low[a] = cellOf(lo[a], a);
      high[a] = cellOf(hi[a], a);
    }
    for (std::int64_t z = low[2]; z <= high[2]; ++z) {
      for (std::int64_t y = low[1]; y <= high[1]; ++y) {
        for (std::int64_t x = low[0]; x <= high[0]; ++x) {
          if (test(static_cast<std::size_t>((z * cells_[1] + y) * cells_[0] + x))) return true;
        }
      }
    }
    return false;
  }
};

}  // namespace dccd
