#include "proof/looked.h"

#include <algorithm>

namespace dccd {
namespace {

// Of two bodies: vertices of the first or of the second one against faces of the other, edges against edges.
constexpr std::uint8_t FIRST_VERTICES = 1, SECOND_VERTICES = 2, EDGES = 4, VOXELS = 8;
constexpr std::uint8_t OF_ITSELF = FIRST_VERTICES | EDGES, OF_TWO = FIRST_VERTICES | SECOND_VERTICES | EDGES;

}  // namespace

void Looked::begin() {
  marks_.clear();
  near_.clear();
  compared_ = start_ = false;
}

void Looked::compared(const std::vector<std::uint32_t>& near) {
  near_ = near;
  compared_ = true;
}

void Looked::at(PairKind kind, std::size_t a, std::size_t b) {
  mark(a, b, kind == PairKind::EDGE_EDGE ? EDGES : a <= b ? FIRST_VERTICES : SECOND_VERTICES);
}
void Looked::atItself(std::size_t body) { mark(body, body, OF_ITSELF); }
void Looked::atMap(std::size_t body) { mark(body, OBSTACLE_BODY, VOXELS); }

void Looked::mark(std::size_t a, std::size_t b, std::uint8_t tests) {
  marks_.push_back({static_cast<std::uint32_t>(std::min(a, b) << 16 | std::max(a, b)), tests});
}

/// Of marks in the order of the bodies.
bool Looked::holds(std::size_t a, std::size_t b, std::uint8_t tests) const {
  const auto bodies = static_cast<std::uint32_t>(a << 16 | b);
  auto mark = std::lower_bound(marks_.begin(), marks_.end(), bodies,
                               [](const Mark& one, std::uint32_t of) { return one.bodies < of; });
  std::uint8_t found = 0;
  for (; mark != marks_.end() && mark->bodies == bodies; ++mark) found |= mark->tests;
  return (found & tests) == tests;
}

std::vector<Gap> Looked::gaps(const std::vector<Body>& bodies, bool has_map, bool has_start) {
  std::vector<Gap> gaps;
  const auto require = [&](std::size_t a, std::size_t b, std::uint8_t tests) {
    if (!holds(a, b, tests)) gaps.push_back({{static_cast<std::uint16_t>(a), static_cast<std::uint16_t>(b)}});
  };
  std::sort(marks_.begin(), marks_.end(), [](const Mark& x, const Mark& y) { return x.bodies < y.bodies; });
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (meetsItself(bodies[b])) require(b, b, OF_ITSELF);
    if (has_map && meetsMap(bodies[b])) require(b, OBSTACLE_BODY, VOXELS);
  }
  for (std::size_t p = 0; compared_ && p < near_.size(); p += 2) {
    const std::size_t a = near_[p], b = near_[p + 1];
    if (meet(bodies[a], a, bodies[b], b)) require(a, b, OF_TWO);
  }
  for (std::size_t a = 0; !compared_ && a < bodies.size(); ++a) {
    for (std::size_t b = a + 1; b < bodies.size(); ++b) {
      if (meet(bodies[a], a, bodies[b], b)) require(a, b, OF_TWO);
    }
  }
  if (has_start && !start_) gaps.push_back({{0, 0}, true});
  return gaps;
}

}  // namespace dccd
