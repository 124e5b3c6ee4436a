#include "culling/surface_cells.h"

#include <algorithm>

namespace dccd {
namespace {

using simd::GROUP;

constexpr std::uint32_t NONE = 0xffffffff;
constexpr std::size_t MOST_SIDES_AT_A_VERTEX = 1024;  // finding the faces beside each other takes their square

}  // namespace

class SurfaceCells::Builder {
 public:
  Builder(const SceneBody& body, SurfaceCells& cells)
      : body_(body), faces_(body.tree(FeatureKind::FACE)), cells_(cells) {}

  void build() {
    const std::size_t count = (faces_.featureCount() + GROUP - 1) / GROUP;
    cells_.sound_.assign(count, 1);
    cells_.whole_ = true;
    sortSides();
    for (std::uint32_t c = 0; c < count; ++c) addCell(c);
    cells_.neighbours_.push_back({BORDER, static_cast<std::uint32_t>(cells_.sides_.size())});
    cells_.neighbours_.shrink_to_fit();
    cells_.sides_.shrink_to_fit();
    for (const FeatureKind kind : {FeatureKind::VERTEX, FeatureKind::EDGE, FeatureKind::FACE}) findHomes(kind);
  }

 private:
  static std::uint32_t cellOf(std::uint32_t side) { return static_cast<std::uint32_t>(side / (3 * GROUP)); }
  Index from(std::uint32_t side) const { return faces_.feature(side / 3)[side % 3]; }
  Index to(std::uint32_t side) const { return faces_.feature(side / 3)[side % 3 == 2 ? 0 : side % 3 + 1]; }
  std::size_t countAt(Index vertex) const {
    return begin_[vertex - body_.internal_begin + 1] - begin_[vertex - body_.internal_begin];
  }

  /// By the vertices that they begin at.
  void sortSides() {
    const std::size_t n = 3 * faces_.featureCount();
    begin_.assign(body_.usedCount() + 1, 0);
    for (std::uint32_t s = 0; s < n; ++s) ++begin_[from(s) - body_.internal_begin + 1];
    for (std::size_t v = 0; v < body_.usedCount(); ++v) begin_[v + 1] += begin_[v];
    at_.resize(n);
    std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
    for (std::uint32_t s = 0; s < n; ++s) at_[next[from(s) - body_.internal_begin]++] = {to(s), s};
  }

  /// Number of sides from one vertex to another; `found` is one of them.
  std::size_t sidesBetween(Index a, Index b, std::uint32_t& found) const {
    std::size_t count = 0;
    for (std::uint32_t i = begin_[a - body_.internal_begin]; i < begin_[a - body_.internal_begin + 1]; ++i) {
      if (at_[i].to != b) continue;
      found = at_[i].side;
      ++count;
    }
    return count;
  }

  void addCell(std::uint32_t cell) {
    const auto first = static_cast<std::uint32_t>(cell * 3 * GROUP);
    outer_.clear();
    for (std::uint32_t s = first; s < std::min<std::size_t>(first + 3 * GROUP, 3 * faces_.featureCount()); ++s) {
      const Index a = from(s), b = to(s);
      std::uint32_t same = NONE, other = NONE;
      const bool few = std::max(countAt(a), countAt(b)) <= MOST_SIDES_AT_A_VERTEX;
      const std::size_t others = few ? sidesBetween(b, a, other) : 2;
      const std::uint32_t beside = others == 0 ? BORDER : cellOf(other);
      if (others > 1 || sidesBetween(a, b, same) > 1) {
        cells_.sound_[cell] = cells_.whole_ = 0;
      } else if (beside != cell) {
        outer_.emplace_back(beside, s);
      }
    }
    std::sort(outer_.begin(), outer_.end());
    for (std::size_t i = 0; i < outer_.size(); ++i) {
      if (i == 0 || outer_[i].first != outer_[i - 1].first) {
        cells_.neighbours_.push_back({outer_[i].first, static_cast<std::uint32_t>(cells_.sides_.size())});
      }
      cells_.sides_.push_back({from(outer_[i].second), to(outer_[i].second)});
    }
    cells_.begin_.push_back(static_cast<std::uint32_t>(cells_.neighbours_.size()));
  }

  /// Some side of a face with the feature; NONE: there is none.
  std::uint32_t sideOf(FeatureKind kind, std::size_t slot) const {
    const Index* v = body_.tree(kind).feature(slot);
    if (kind == FeatureKind::FACE) return static_cast<std::uint32_t>(3 * slot);
    if (kind == FeatureKind::VERTEX) return countAt(v[0]) > 0 ? at_[begin_[v[0] - body_.internal_begin]].side : NONE;
    std::uint32_t side = NONE;
    if (sidesBetween(v[0], v[1], side) == 0) sidesBetween(v[1], v[0], side);
    return side;
  }

  void findHomes(FeatureKind kind) {
    Homes& homes = cells_.homes_[static_cast<int>(kind)];
    const std::size_t count = body_.tree(kind).featureCount();
    for (std::size_t first = 0; first < count; first += GROUP) {
      const auto begin = static_cast<std::ptrdiff_t>(homes.cells.size());
      for (std::size_t slot = first; slot < std::min(first + GROUP, count); ++slot) {
        const std::uint32_t side = sideOf(kind, slot);
        homes.cells.push_back(side == NONE ? NONE : cellOf(side));
      }
      std::sort(homes.cells.begin() + begin, homes.cells.end());
      homes.cells.erase(std::unique(homes.cells.begin() + begin, homes.cells.end()), homes.cells.end());
      if (homes.cells.back() == NONE) {
        homes.cells.resize(static_cast<std::size_t>(begin));
        cells_.whole_ = false;
      }
      homes.begin.push_back(static_cast<std::uint32_t>(homes.cells.size()));
    }
    homes.cells.shrink_to_fit();
  }

  struct Way {
    Index to;
    std::uint32_t side;
  };
  const SceneBody& body_;
  const ClusterTree& faces_;
  SurfaceCells& cells_;
  std::vector<std::uint32_t> begin_;  // per used vertex: where its ways begin
  std::vector<Way> at_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> outer_;  // of a cell: cell beside it, side
};

SurfaceCells::SurfaceCells(const SceneBody& body) { Builder(body, *this).build(); }

}  // namespace dccd
