#include "input/soup_weld.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <unordered_map>

namespace dccd {

namespace {

/// Bits of a corner's coordinates; zeros of either sign are the same place.
struct CornerKey {
  std::uint64_t bits[3];
  Index group;
  bool operator==(const CornerKey& o) const {
    return bits[0] == o.bits[0] && bits[1] == o.bits[1] && bits[2] == o.bits[2] && group == o.group;
  }
};
struct CornerHash {
  std::size_t operator()(const CornerKey& key) const {
    std::uint64_t h = key.group;
    for (const std::uint64_t b : key.bits) h = (h ^ b) * 0x9e3779b97f4a7c15ull, h ^= h >> 29;
    return static_cast<std::size_t>(h);
  }
};
CornerKey cornerKey(const Vec3& p, Index group) {
  CornerKey key{{0, 0, 0}, group};
  for (int axis = 0; axis < 3; ++axis) {
    const double value = p[axis] == 0 ? 0.0 : p[axis];
    std::memcpy(&key.bits[axis], &value, 8);
  }
  return key;
}

}  // namespace

std::size_t SoupWeld::weld(const Positions& corners) {
  const bool known = vertex_.size() == corners.size();
  return known && holds(corners) ? 0 : weldAnew(corners, known);
}

void SoupWeld::keepApart(std::size_t count) {
  if (vertex_.size() == count && corner_.size() == count) return;  // as it is
  vertex_.resize(count);
  std::iota(vertex_.begin(), vertex_.end(), Index{0});
  corner_ = vertex_;
}

void SoupWeld::forget() {
  vertex_.clear();
  corner_.clear();
}

bool SoupWeld::holds(const Positions& corners) const {
  for (std::size_t c = 0; c < corners.size(); ++c) {
    if (!(cornerKey(corners[c], 0) == cornerKey(corners[corner_[vertex_[c]]], 0))) return false;
  }
  return true;
}

std::size_t SoupWeld::weldAnew(const Positions& corners, bool refine) {
  // Refining splits groups and never joins any: what touches now for the first time is contact, not mesh.
  std::unordered_map<CornerKey, Index, CornerHash> groups;
  groups.reserve(corners.size());
  std::vector<Index> vertex(corners.size());
  std::vector<Index> corner;
  std::vector<std::size_t> pieces(refine ? corner_.size() : 0, 0);  // of each vertex
  for (std::size_t c = 0; c < corners.size(); ++c) {
    const auto [it, fresh] =
        groups.try_emplace(cornerKey(corners[c], refine ? vertex_[c] : 0), static_cast<Index>(corner.size()));
    if (fresh) corner.push_back(static_cast<Index>(c));
    if (fresh && refine) ++pieces[vertex_[c]];
    vertex[c] = it->second;
  }
  vertex_ = std::move(vertex);
  corner_ = std::move(corner);
  const auto apart = [](std::size_t count) { return count > 1; };
  return static_cast<std::size_t>(std::count_if(pieces.begin(), pieces.end(), apart));
}

}  // namespace dccd
