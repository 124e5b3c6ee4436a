#include "culling/unfolded_parts.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "culling/unfolded_parts_builder.h"

namespace dccd {
namespace {

using simd::AOS_SIZE;
using simd::DIRECTIONS;
using simd::GROUP;
using simd::RECORD;

constexpr int OPPOSITE = 127;  // no turn, but half of one to either side
constexpr std::size_t CELLS_A_PIECE = 256, CLUSTERS_AT_ONCE = 32;

/// The half-planes of a view: bits as of simd::sidesOf(), in the order of their angles, counter-clockwise.
struct View {
  std::uint16_t allowed = 0;
  int count = 0;
  std::array<std::uint8_t, 2 * DIRECTIONS> side{};   ///< by place
  std::array<std::uint8_t, 2 * DIRECTIONS> place{};  ///< by side

  explicit View(std::size_t number) {
    constexpr int DIRECTION[DIRECTIONS][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1},  {1, 1, 0},
                                              {1, 0, 1}, {0, 1, 1}, {1, -1, 0}, {0, 1, -1}};
    const int* line = simd::VIEW_LINE[number / 2];
    const Vec3 along = (number % 2 ? -1.0 : 1.0) * Vec3(line[0], line[1], line[2]);
    const Vec3 u = along.unitOrthogonal(), w = along.normalized().cross(u);
    std::vector<std::pair<double, std::uint8_t>> angles;
    for (std::uint8_t d = 0; d < DIRECTIONS; ++d) {
      const Vec3 direction(DIRECTION[d][0], DIRECTION[d][1], DIRECTION[d][2]);
      if (direction.dot(along) != 0) continue;  // of small integers, exact
      angles.emplace_back(std::atan2(w.dot(direction), u.dot(direction)), d);
      angles.emplace_back(std::atan2(-w.dot(direction), -u.dot(direction)), d + DIRECTIONS);
    }
    std::sort(angles.begin(), angles.end());  // at least a twelfth of a turn apart
    for (const auto& [angle, bit] : angles) {
      allowed = static_cast<std::uint16_t>(allowed | 1u << bit);
      place[bit] = static_cast<std::uint8_t>(count);
      side[static_cast<std::size_t>(count++)] = bit;
    }
  }
  /// In places.
  int turn(int from, int to) const {
    const int turn = (to - from + count) % count;
    return 2 * turn == count ? OPPOSITE : 2 * turn > count ? turn - count : turn;
  }
};

const View& viewOf(std::size_t number) {
  static const std::vector<View> VIEWS = [] {
    std::vector<View> views;
    for (std::size_t v = 0; v < simd::VIEWS; ++v) views.emplace_back(v);
    return views;
  }();
  return VIEWS[number];
}

std::size_t lowestBit(std::uint32_t bits) { return static_cast<std::size_t>(__builtin_ctz(bits)); }

/// Strictly further in a side's direction at t=0 and at t=1. Values as of a record.
bool isBeyond(std::uint8_t side, const std::int16_t* x, const std::int16_t* y) {
  const std::size_t d = side % DIRECTIONS;
  return side < DIRECTIONS ? x[d] > y[d] && x[DIRECTIONS + d] > y[DIRECTIONS + d]
                           : x[d] < y[d] && x[DIRECTIONS + d] < y[DIRECTIONS + d];
}

}  // namespace

NearClusters::NearClusters(std::size_t groups_a, std::size_t groups_b, bool same_tree)
    : same_tree_(same_tree), begin_(groups_a + 1), certain_a_(groups_a), certain_b_(same_tree ? 0 : groups_b) {}

void NearClusters::add(std::uint32_t a, const std::vector<std::uint32_t>& near_b) {
  const std::uint32_t group = a / GROUP;
  for (const std::uint32_t b : near_b) {
    if (same_tree_ && b < a) continue;
    const auto first = blocks_.begin() + begin_[group];
    auto block = std::find_if(first, blocks_.end(), [&](const Block& one) { return one.b == b / GROUP; });
    if (block == blocks_.end()) block = blocks_.insert(block, {static_cast<std::uint32_t>(b / GROUP), {}});
    std::uint16_t& row = block->near[a % GROUP];
    row = static_cast<std::uint16_t>(row | 1u << b % GROUP);
  }
  std::fill(begin_.begin() + group + 1, begin_.end(), static_cast<std::uint32_t>(blocks_.size()));
}

const NearClusters::Block* NearClusters::find(std::uint32_t a, std::uint32_t b) const {
  const Block *first = blocks_.data() + begin_[a], *last = blocks_.data() + begin_[a + 1];
  const Block* block = std::find_if(first, last, [b](const Block& one) { return one.b == b; });
  return block == last ? nullptr : block;
}

std::size_t NearClusters::leaveOut(std::uint32_t* pairs, std::size_t count) const {
  const std::vector<std::uint16_t>& certain_b = same_tree_ ? certain_a_ : certain_b_;
  std::size_t left = 0;
  std::uint32_t group_a = NO_INDEX, group_b = NO_INDEX;
  const Block* block = nullptr;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t a = pairs[2 * i], b = pairs[2 * i + 1];
    if (a / GROUP != group_a || b / GROUP != group_b) {
      group_a = a / GROUP, group_b = b / GROUP;
      block = find(group_a, group_b);
    }
    pairs[2 * left] = a;
    pairs[2 * left + 1] = b;
    const bool out = block && block->near[a % GROUP] >> b % GROUP & 1u &
                                  (certain_a_[group_a] >> a % GROUP | certain_b[group_b] >> b % GROUP);
    left += !out;
  }
  return left;
}

UnfoldedParts::UnfoldedParts(const SceneBody& body, std::size_t clusters_of_a_cell) : clusters_(clusters_of_a_cell) {
  UnfoldedPartsBuilder(body, *this).build();
}

std::size_t UnfoldedParts::runWhereItPays(const SceneBody& body, const SceneArrays& scene, const Parallel& parallel) {
  clear();
  if (left_out_runs_ > 0) {
    --left_out_runs_;
    return 0;
  }
  const std::size_t certified = run(body, scene, parallel);
  if (certified * FEW < cell_count_) left_out_runs_ = RUNS_LEFT_OUT;
  return certified;
}

std::size_t UnfoldedParts::run(const SceneBody& body, const SceneArrays& scene, const Parallel& parallel) {
  clear();
  if (cell_count_ == 0) return 0;
  const ClusterTree& faces = body.tree(FeatureKind::FACE);
  findFacedViews(faces, scene.vertices(), parallel);
  if (std::find(wanted_.begin(), wanted_.end(), 1) == wanted_.end()) return 0;
  const ClusterTree::Level& leaves = faces.level(0);
  for (std::size_t c = 0; c < cell_count_; ++c) {
    std::int16_t* bounds = bounds_.data() + c * AOS_SIZE;
    const std::size_t first = c * clusters_, last = std::min(first + clusters_, leaves.groups);
    std::copy_n(leaves.aos.data() + first * AOS_SIZE, AOS_SIZE, bounds);
    for (std::size_t g = first + 1; g < last; ++g) {
      const std::int16_t* more = leaves.aos.data() + g * AOS_SIZE;
      for (std::size_t k = 0; k < RECORD; ++k) bounds[k] = std::min(bounds[k], more[k]);
      for (std::size_t k = RECORD; k < AOS_SIZE; ++k) bounds[k] = std::max(bounds[k], more[k]);
    }
  }
  parallel(cell_count_, CELLS_A_PIECE, [&](std::size_t first, std::size_t last) {
    for (std::size_t c = first; c < last; ++c) certified_[c] = isCertified(c, scene);
  });
  certified_count_ = static_cast<std::size_t>(std::count(certified_.begin(), certified_.end(), 1));
  if (certified_count_ > 0) markClusters();
  return certified_count_;
}

/// Of what is around a cell that may be certified, by one face of each cell, all faces are looked at.
void UnfoldedParts::findFacedViews(const ClusterTree& faces, const VertexMotion* vertices, const Parallel& parallel) {
  const auto* positions = reinterpret_cast<const double*>(vertices);
  const std::size_t clusters = faces.level(0).groups;
  simd::facedViews(positions, sampled_.data(), sampled_.size() / (3 * GROUP), sampled_views_.data());
  std::copy_n(sampled_views_.begin(), cell_count_, views_.begin());
  std::fill(wanted_.begin(), wanted_.end(), 0);
  for (std::size_t c = 0; c < cell_count_; ++c) {
    if (!sound_[c] || viewsOfPart(c) == 0) continue;
    for (const std::uint32_t* cell = part_.first(c); cell != part_.last(c); ++cell) wanted_[*cell] = 1;
  }
  const std::uint32_t* groups = faces.leaves(false).vertices;
  parallel(cell_count_, CELLS_A_PIECE, [&](std::size_t first, std::size_t last) {
    // Cells that follow each other go together.
    std::uint32_t views[CLUSTERS_AT_ONCE * GROUP];
    for (std::size_t c = first, end = first; c < last; c = end) {
      end = c + 1;
      if (!wanted_[c]) {
        views_[c] = 0;
        continue;
      }
      while (end < last && wanted_[end] && (end + 1 - c) * clusters_ <= CLUSTERS_AT_ONCE) ++end;
      const std::size_t begin = c * clusters_, count = std::min(end * clusters_, clusters) - begin;
      simd::facedViews(positions, groups + begin * 3 * GROUP, count, views);
      const std::uint32_t* face = views;
      for (std::size_t cell = c; cell < end; ++cell) {
        const std::size_t n = std::min(clusters_, clusters - cell * clusters_) * GROUP;
        views_[cell] = std::accumulate(face, face + n, views_[cell], std::bit_and<>());
        face += n;
      }
    }
  });
}

std::uint32_t UnfoldedParts::viewsOfPart(std::size_t cell) const {
  std::uint32_t views = views_[cell];
  for (const std::uint32_t* c = part_.first(cell); c != part_.last(cell) && views != 0; ++c) views &= views_[*c];
  return views;
}

bool UnfoldedParts::isCertified(std::size_t cell, const SceneArrays& scene) const {
  if (!sound_[cell]) return false;
  const std::size_t count = outside_.size(cell);
  std::uint16_t sides[MOST_OUTSIDE];
  std::uint8_t places[MOST_OUTSIDE];
  std::uint32_t views = viewsOfPart(cell);
  if (views != 0) simd::sidesOf(bounds_.data(), static_cast<std::uint32_t>(cell), outside_.first(cell), count, sides);
  for (; views != 0; views &= views - 1) {
    const View& view = viewOf(lowestBit(views));
    const bool apart = std::all_of(sides, sides + count, [&](std::uint16_t s) { return (s & view.allowed) != 0; });
    if (!apart) continue;
    for (std::size_t i = 0; i < count; ++i) places[i] = view.place[lowestBit(sides[i] & view.allowed)];
    int winding = 0;
    for (std::uint32_t t = turn_begin_[cell]; t < turn_begin_[cell + 1]; ++t) {
      winding += turns_[t].times * view.turn(places[turns_[t].from], places[turns_[t].to]);
    }
    if (path_.size(cell) > 0) {
      winding += turnAtPath(cell, lowestBit(views), places[paths_[cell].from], places[paths_[cell].to], scene);
    }
    if (winding == view.count) return true;
  }
  return false;
}

/// Where the border comes to the path in one place and leaves it in another; OPPOSITE: the path does not go on in one
/// direction from before the cell to behind it.
int UnfoldedParts::turnAtPath(std::size_t cell, std::size_t view_number, std::uint8_t from, std::uint8_t to,
                              const SceneArrays& scene) const {
  const View& view = viewOf(view_number);
  const std::int16_t *low = bounds_.data() + cell * AOS_SIZE, *high = low + RECORD;
  const std::uint32_t *first = path_.first(cell), *last = path_.last(cell) - 1;
  const int half = view.count / 2;
  for (int place = 0; place < view.count; ++place) {
    const int before = (place + half) % view.count;
    const std::uint8_t along = view.side[static_cast<std::size_t>(place)],
                       against = view.side[static_cast<std::size_t>(before)];
    const bool ends = isBeyond(along, scene.record(*last), along < DIRECTIONS ? high : low) &&
                      isBeyond(against, scene.record(*first), against < DIRECTIONS ? high : low);
    if (!ends) continue;
    const std::uint32_t* v = first;
    while (v != last && isBeyond(along, scene.record(v[1]), scene.record(v[0]))) ++v;
    if (v == last) return view.turn(from, before) + half + view.turn(place, to);
  }
  return OPPOSITE;
}

/// A cluster is certain when all cells are that hold its features.
void UnfoldedParts::markClusters() {
  const auto mark = [&](FeatureKind kind, std::vector<std::uint16_t>& certain) {
    const Lists& homes = homes_[static_cast<int>(kind)];
    std::fill(certain.begin(), certain.end(), 0);
    for (std::size_t g = 0; g + 1 < homes.begin.size(); ++g) {
      const bool all = homes.size(g) > 0 && std::all_of(homes.first(g), homes.last(g),
                                                        [&](std::uint32_t cell) { return certified_[cell] != 0; });
      certain[g / GROUP] = static_cast<std::uint16_t>(certain[g / GROUP] | static_cast<unsigned>(all) << g % GROUP);
    }
  };
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    NearClusters& near = near_[static_cast<int>(kind)];
    mark(firstKind(kind), near.certainOfA());
    if (firstKind(kind) != secondKind(kind)) mark(secondKind(kind), near.certainOfB());
  }
}

}  // namespace dccd
