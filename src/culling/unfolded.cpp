#include "culling/unfolded.h"

#include <algorithm>
#include <atomic>

#include "simd/surface_views.h"

namespace dccd {
namespace {

using simd::GROUP;

constexpr std::size_t GROUPS_A_PIECE = 32;
constexpr std::size_t PIECES_A_THREAD = 8;
constexpr std::uint32_t ALL_VIEWS = (1u << simd::VIEWS) - 1;

ViewPlane planeOf(std::size_t view) {
  const int* line = simd::VIEW_LINE[view / 2];
  return ViewPlane((view % 2 ? -1.0 : 1.0) * Vec3(line[0], line[1], line[2]));
}

/// The vertices of the border, in the direction of its faces; empty: there is none, or it is not one cycle that comes
/// to each of them once, or some edge has three faces, or two that are not the same way round.
std::vector<Index> borderOf(const SceneBody& body) {
  const ClusterTree& faces = body.tree(FeatureKind::FACE);
  if (faces.featureCount() == 0 || body.setup.topology->isClosed()) return {};
  const auto side = [](Index from, Index to) { return std::uint64_t{from} << 32 | to; };
  std::vector<std::uint64_t> sides;
  for (std::size_t slot = 0; slot < faces.featureCount(); ++slot) {
    const Index* v = faces.feature(slot);
    for (std::size_t k = 0; k < 3; ++k) sides.push_back(side(v[k], v[(k + 1) % 3]));
  }
  std::sort(sides.begin(), sides.end());
  if (std::adjacent_find(sides.begin(), sides.end()) != sides.end()) return {};
  std::vector<Index> next(body.usedCount(), NO_INDEX), border;
  std::size_t length = 0;
  Index start = NO_INDEX;
  for (const std::uint64_t s : sides) {
    const auto from = static_cast<Index>(s >> 32), to = static_cast<Index>(s);
    if (std::binary_search(sides.begin(), sides.end(), side(to, from))) continue;
    Index& after = next[from - body.internal_begin];
    if (after != NO_INDEX) return {};
    after = to;
    start = from;
    ++length;
  }
  for (Index at = start; border.empty() || at != start; at = next[at - body.internal_begin]) border.push_back(at);
  return border.size() == length ? border : std::vector<Index>();
}

}  // namespace

Unfolded::Unfolded(const SceneBody& body) {
  if (!meetsItself(body.setup)) return;
  std::vector<Index> border = borderOf(body);
  if (!border.empty()) border_.emplace(std::move(border));
}

/// That all faces face; 0 as soon as there is none. What ended the last search comes first.
std::uint32_t Unfolded::commonViews(const ClusterTree& faces, const VertexMotion* vertices, const Parallel& parallel) {
  const auto* positions = reinterpret_cast<const double*>(vertices);
  const std::uint32_t* corners = faces.leaves(false).vertices;
  const std::size_t groups = (faces.featureCount() + GROUP - 1) / GROUP;
  const std::size_t pieces = (groups + GROUPS_A_PIECE - 1) / GROUPS_A_PIECE;
  std::atomic<std::uint32_t> common{ALL_VIEWS};
  std::atomic<std::size_t> ended_in{first_piece_};
  parallel(pieces, PIECES_A_THREAD, [&](std::size_t first, std::size_t last) {
    std::uint32_t views[GROUPS_A_PIECE * GROUP];
    for (std::size_t i = first; i < last && common != 0; ++i) {
      const std::size_t piece = (i + first_piece_) % pieces, begin = piece * GROUPS_A_PIECE;
      const std::size_t count = std::min(GROUPS_A_PIECE, groups - begin);
      simd::facedViews(positions, corners + begin * 3 * GROUP, count, views);
      std::uint32_t faced = ALL_VIEWS;
      for (std::size_t face = 0; face < count * GROUP; ++face) faced &= views[face];
      if ((common.fetch_and(faced) & faced) == 0) ended_in = piece;
    }
  });
  first_piece_ = ended_in;
  return common;
}

void Unfolded::run(const SceneBody& body, const VertexMotion* vertices, const Parallel& parallel) {
  clear();
  if (!border_) return;
  const std::uint32_t views = commonViews(body.tree(FeatureKind::FACE), vertices, parallel);
  if (views == 0) return;
  const auto from = [views](std::size_t first) { return static_cast<std::uint64_t>(views) >> first << first; };
  const std::uint64_t after = from(view_);
  view_ = static_cast<std::size_t>(__builtin_ctzll(after != 0 ? after : views));
  certified_ = border_->isSimple(planeOf(view_), vertices);
  if (!certified_) ++view_;
}

}  // namespace dccd
