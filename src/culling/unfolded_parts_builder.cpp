#include "culling/unfolded_parts_builder.h"

#include <algorithm>
#include <tuple>

namespace dccd {
namespace {

using simd::GROUP;

template <class T>
void sortOut(std::vector<T>& items) {
  std::sort(items.begin(), items.end());
  items.erase(std::unique(items.begin(), items.end()), items.end());
}

}  // namespace

UnfoldedPartsBuilder::UnfoldedPartsBuilder(const SceneBody& body, UnfoldedParts& parts)
    : body_(body), faces_(body.tree(FeatureKind::FACE)), parts_(parts), faces_of_a_cell_(parts.clusters_ * GROUP) {}

void UnfoldedPartsBuilder::build() {
  if (!meetsItself(body_.setup)) return;
  const std::size_t cells = (faces_.featureCount() + faces_of_a_cell_ - 1) / faces_of_a_cell_;
  parts_.cell_count_ = cells;
  if (cells == 0) return;
  findPartners();
  findFans();
  findParts();
  in_part_of_.assign(cells, 0);
  parts_.turn_begin_.push_back(0);
  for (std::uint32_t c = 0; c < cells; ++c) {
    const std::size_t outside = parts_.outside_.items.size(), turns = parts_.turns_.size();
    parts_.paths_.emplace_back();
    parts_.sound_.push_back(describeBorder(c));
    if (!parts_.sound_.back()) {
      parts_.outside_.items.resize(outside);
      parts_.turns_.resize(turns);
      parts_.path_.items.resize(parts_.path_.begin.back());
    }
    parts_.outside_.close();
    parts_.path_.close();
    parts_.turn_begin_.push_back(static_cast<std::uint32_t>(parts_.turns_.size()));
  }
  for (const FeatureKind kind : {FeatureKind::VERTEX, FeatureKind::EDGE, FeatureKind::FACE}) findHomes(kind);
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) findNear(firstKind(kind), secondKind(kind));
  sampleFaces();
  parts_.views_.resize(cells);
  parts_.wanted_.resize(cells);
  parts_.certified_.resize(cells);
  parts_.bounds_.resize(cells * simd::AOS_SIZE);
}

void UnfoldedPartsBuilder::findPartners() {
  std::vector<std::tuple<Index, Index, std::size_t>> sides;  // the smaller end, the larger one, which side it is
  for (std::size_t s = 0; s < 3 * faces_.featureCount(); ++s) {
    const auto [low, high] = std::minmax({cornerOf(s), nextCornerOf(s)});
    sides.emplace_back(low, high, s);
  }
  std::sort(sides.begin(), sides.end());
  partner_.assign(sides.size(), BORDER);
  for (std::size_t i = 0, end = 0; i < sides.size(); i = end) {
    const auto [low, high, side] = sides[i];
    for (end = i + 1; end < sides.size() && std::get<0>(sides[end]) == low && std::get<1>(sides[end]) == high; ++end) {
    }
    if (end - i == 1) continue;
    const std::size_t other = std::get<2>(sides[i + 1]);
    const bool two = end - i == 2 && cornerOf(side) == nextCornerOf(other);
    for (std::size_t k = i; k < end; ++k) partner_[std::get<2>(sides[k])] = UNSOUND;
    if (!two) continue;
    partner_[side] = static_cast<Index>(other / 3);
    partner_[other] = static_cast<Index>(side / 3);
  }
}

void UnfoldedPartsBuilder::findFans() {
  fan_begin_.assign(body_.usedCount() + 1, 0);
  for (std::size_t s = 0; s < partner_.size(); ++s) ++fan_begin_[cornerOf(s) - body_.internal_begin + 1];
  for (std::size_t v = 0; v < body_.usedCount(); ++v) fan_begin_[v + 1] += fan_begin_[v];
  fan_.resize(partner_.size());
  std::vector<std::uint32_t> next(fan_begin_.begin(), fan_begin_.end() - 1);
  for (std::size_t s = 0; s < partner_.size(); ++s) {
    fan_[next[cornerOf(s) - body_.internal_begin]++] = static_cast<std::uint32_t>(s / 3);
  }
}

void UnfoldedPartsBuilder::findParts() {
  std::vector<std::vector<std::uint32_t>> beside(parts_.cell_count_);
  std::vector<std::uint32_t> cells;
  for (std::size_t v = 0; v < body_.usedCount(); ++v) {
    cells.clear();
    for (std::uint32_t i = fan_begin_[v]; i < fan_begin_[v + 1]; ++i) cells.push_back(cellOf(fan_[i]));
    sortOut(cells);
    for (const std::uint32_t c : cells) beside[c].insert(beside[c].end(), cells.begin(), cells.end());
  }
  for (std::vector<std::uint32_t>& list : beside) sortOut(list);
  for (const std::vector<std::uint32_t>& list : beside) {
    cells.clear();
    for (const std::uint32_t c : list) cells.insert(cells.end(), beside[c].begin(), beside[c].end());
    sortOut(cells);
    parts_.part_.items.insert(parts_.part_.items.end(), cells.begin(), cells.end());
    parts_.part_.close();
  }
  outer_side_.resize(parts_.cell_count_);
  for (std::size_t s = 0; s < partner_.size(); ++s) {
    const bool inner = partner_[s] < UNSOUND && cellOf(partner_[s]) == cellOf(s / 3);
    if (!inner) outer_side_[cellOf(s / 3)].push_back(s);
  }
}

bool UnfoldedPartsBuilder::describeBorder(std::uint32_t cell) {
  const std::uint32_t *first = parts_.part_.first(cell), *last = parts_.part_.last(cell);
  for (const std::uint32_t* c = first; c != last; ++c) in_part_of_[*c] = cell + 1;
  std::vector<std::size_t> border, path;
  std::vector<std::uint32_t> outside;
  for (const std::uint32_t* c = first; c != last; ++c) {
    for (const std::size_t side : outer_side_[*c]) {
      if (partner_[side] == UNSOUND) return false;
      if (partner_[side] == BORDER) {
        path.push_back(side);
      } else if (in_part_of_[cellOf(partner_[side])] != cell + 1) {
        border.push_back(side);
        outside.push_back(cellOf(partner_[side]));
      }
    }
  }
  sortOut(outside);
  if (outside.size() > UnfoldedParts::MOST_OUTSIDE) return false;
  parts_.outside_.items.insert(parts_.outside_.items.end(), outside.begin(), outside.end());

  // At each vertex as many edges of the border end as begin. Those of the path come first, and go together.
  using End = std::pair<Index, std::size_t>;  // vertex, and place of the outside cell, from 1 on
  std::vector<End> comes, goes;
  for (const std::size_t side : path) {
    goes.emplace_back(cornerOf(side), 0);
    comes.emplace_back(nextCornerOf(side), 0);
  }
  for (const std::size_t side : border) {
    const auto place = std::lower_bound(outside.begin(), outside.end(), cellOf(partner_[side])) - outside.begin() + 1;
    goes.emplace_back(cornerOf(side), place);
    comes.emplace_back(nextCornerOf(side), place);
  }
  std::sort(comes.begin(), comes.end());
  std::sort(goes.begin(), goes.end());
  std::vector<std::pair<std::uint8_t, std::uint8_t>> turns;
  std::size_t begun = 0, ended = 0;
  Index path_first = NO_INDEX, path_last = NO_INDEX;
  for (std::size_t i = 0; i < comes.size(); ++i) {
    const std::size_t from = comes[i].second, to = goes[i].second;
    if (from == to) continue;
    if (to == 0) {
      ++begun;
      path_first = goes[i].first;
      parts_.paths_.back().from = static_cast<std::uint8_t>(from - 1);
    } else if (from == 0) {
      ++ended;
      path_last = comes[i].first;
      parts_.paths_.back().to = static_cast<std::uint8_t>(to - 1);
    } else {
      turns.emplace_back(from - 1, to - 1);
    }
  }
  std::sort(turns.begin(), turns.end());
  for (std::size_t i = 0, end = 0; i < turns.size(); i = end) {
    for (end = i + 1; end < turns.size() && turns[end] == turns[i]; ++end) {
    }
    parts_.turns_.push_back({turns[i].first, turns[i].second, static_cast<std::uint16_t>(end - i)});
  }
  return path.empty() || (begun == 1 && ended == 1 && describePath(path, path_first, path_last));
}

/// False: the sides are not all on one way from the first vertex to the last.
bool UnfoldedPartsBuilder::describePath(std::vector<std::size_t> sides, Index first, Index last) {
  std::vector<std::uint32_t>& vertices = parts_.path_.items;
  vertices.push_back(first);
  while (vertices.back() != last) {
    const auto next =
        std::find_if(sides.begin(), sides.end(), [&](std::size_t side) { return cornerOf(side) == vertices.back(); });
    if (next == sides.end()) return false;
    vertices.push_back(nextCornerOf(*next));
    sides.erase(next);
  }
  return sides.empty();
}

/// NO_INDEX: there is none.
Index UnfoldedPartsBuilder::faceWith(FeatureKind kind, std::size_t slot) const {
  if (kind == FeatureKind::FACE) return static_cast<Index>(slot);
  const Index* feature = body_.tree(kind).feature(slot);
  const std::size_t arity = body_.tree(kind).arity(), vertex = feature[0] - body_.internal_begin;
  for (std::uint32_t i = fan_begin_[vertex]; i < fan_begin_[vertex + 1]; ++i) {
    const Index* face = faces_.feature(fan_[i]);
    if (std::find(face, face + 3, feature[arity - 1]) != face + 3) return fan_[i];
  }
  return NO_INDEX;
}

void UnfoldedPartsBuilder::findHomes(FeatureKind kind) {
  UnfoldedParts::Lists& homes = parts_.homes_[static_cast<int>(kind)];
  const std::size_t count = body_.tree(kind).featureCount();
  std::vector<std::uint32_t> cells;
  for (std::size_t first = 0; first < count; first += GROUP) {
    cells.clear();
    bool all = true;
    for (std::size_t slot = first; slot < std::min(first + GROUP, count); ++slot) {
      const Index face = faceWith(kind, slot);
      all = all && face != NO_INDEX;
      if (all) cells.push_back(cellOf(face));
    }
    sortOut(cells);
    if (all) homes.items.insert(homes.items.end(), cells.begin(), cells.end());
    homes.close();
  }
}

void UnfoldedPartsBuilder::findNear(FeatureKind kind_a, FeatureKind kind_b) {
  const UnfoldedParts::Lists &homes_a = parts_.homes_[static_cast<int>(kind_a)],
                             &homes_b = parts_.homes_[static_cast<int>(kind_b)];
  const std::size_t clusters_a = homes_a.begin.size() - 1, clusters_b = homes_b.begin.size() - 1;
  const auto groups = [](std::size_t clusters) { return (clusters + GROUP - 1) / GROUP; };
  NearClusters near(groups(clusters_a), groups(clusters_b), kind_a == kind_b);
  std::vector<std::vector<std::uint32_t>> in_cell(parts_.cell_count_);
  for (std::uint32_t b = 0; b < clusters_b; ++b) {
    for (const std::uint32_t* cell = homes_b.first(b); cell != homes_b.last(b); ++cell) in_cell[*cell].push_back(b);
  }
  // Marks of a cell: with how many of the cluster's homes it is in a part, counted on from cluster to cluster.
  std::vector<std::uint32_t> marks(parts_.cell_count_, 0), seen(clusters_b, NO_INDEX), found;
  std::uint32_t marked = 0;
  for (std::uint32_t a = 0; a < clusters_a; ++a) {
    const std::uint32_t none = marked;
    for (const std::uint32_t* home = homes_a.first(a); home != homes_a.last(a); ++home, ++marked) {
      for (const std::uint32_t* cell = parts_.part_.first(*home); cell != parts_.part_.last(*home); ++cell) {
        if (marked == none || marks[*cell] == marked) marks[*cell] = marked + 1;
      }
    }
    if (marked == none) continue;
    const auto isMarked = [&](std::uint32_t cell) { return marks[cell] == marked; };
    const std::uint32_t first = *homes_a.first(a);
    found.clear();
    for (const std::uint32_t* cell = parts_.part_.first(first); cell != parts_.part_.last(first); ++cell) {
      if (!isMarked(*cell)) continue;
      for (const std::uint32_t b : in_cell[*cell]) {
        if (seen[b] == a) continue;
        seen[b] = a;
        if (std::all_of(homes_b.first(b), homes_b.last(b), isMarked)) found.push_back(b);
      }
    }
    std::sort(found.begin(), found.end());
    near.add(a, found);
  }
  parts_.near_.push_back(std::move(near));
}

void UnfoldedPartsBuilder::sampleFaces() {
  const std::size_t groups = (parts_.cell_count_ + GROUP - 1) / GROUP;
  parts_.sampled_.assign(groups * 3 * GROUP, NO_INDEX);
  parts_.sampled_views_.resize(groups * GROUP);
  for (std::size_t c = 0; c < parts_.cell_count_; ++c) {
    const Index* face = faces_.feature(c * faces_of_a_cell_);
    for (std::size_t k = 0; k < 3; ++k) parts_.sampled_[(c / GROUP * 3 + k) * GROUP + c % GROUP] = face[k];
  }
}

}  // namespace dccd
