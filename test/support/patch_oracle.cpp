#include "support/patch_oracle.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <set>
#include <sstream>
#include <tuple>

namespace dccd {
namespace test {

PatchOracle::PatchOracle(const Outcome& outcome) : outcome_(outcome) {
  for (const Body& body : outcome.step->bodies) {
    joined_.emplace_back(body.topology->vertexCount());
    for (const Edge& edge : body.topology->edges()) {
      joined_.back()[edge[0]].push_back(edge[1]);
      joined_.back()[edge[1]].push_back(edge[0]);
    }
  }
  for (const Contact& c : outcome.contacts) {
    Member m;
    std::copy_n(c.body.begin(), 2, m.body);
    const bool map = c.body[1] == OBSTACLE_BODY;
    const int first = c.kind == PairKind::VERTEX_FACE || c.kind == PairKind::VERTEX_VOXEL_FACE ? 1 : map ? 3 : 2;
    for (int i = 0; i < 4; ++i) {
      if (c.vertex[i] == NO_INDEX) continue;
      const int side = i < first ? 0 : 1;
      m.side[side].emplace_back(c.body[side], c.vertex[i]);
    }
    members_.push_back(m);
  }
  for (const StartIntersection& s : outcome.intersections) {
    if (s.vertex[4] == NO_INDEX) continue;
    Member m;
    std::copy_n(s.body.begin(), 2, m.body);
    for (int i = 0; i < 5; ++i) m.side[i < 2 ? 0 : 1].emplace_back(s.body[i < 2 ? 0 : 1], s.vertex[i]);
    members_.push_back(m);
  }
}

/// The area of each vertex that a contact of the two partners has, by a flood along the edges between such vertices.
std::map<PatchOracle::Vertex, std::size_t> PatchOracle::areasOf(const Partners& partners) const {
  std::set<Vertex> touched;
  for (const Member& m : members_) {
    if (m.partners() != partners) continue;
    for (const auto& side : m.side) touched.insert(side.begin(), side.end());
  }
  std::map<Vertex, std::size_t> area;
  for (const Vertex& start : touched) {
    if (!area.emplace(start, area.size()).second) continue;
    const std::size_t number = area.at(start);
    std::vector<Vertex> flood{start};
    while (!flood.empty()) {
      const auto [body, vertex] = flood.back();
      flood.pop_back();
      for (const Index other : joined_[body][vertex]) {
        if (touched.count({body, other}) && area.emplace(Vertex(body, other), number).second) {
          flood.emplace_back(body, other);
        }
      }
    }
  }
  return area;
}

std::vector<std::uint32_t> PatchOracle::patches() const {
  std::map<Partners, std::map<Vertex, std::size_t>> areas;
  std::map<std::tuple<Partners, std::size_t, std::size_t>, std::uint32_t> numbers;
  std::vector<std::uint32_t> patches;
  for (const Member& m : members_) {
    const auto [of_pair, is_new] = areas.try_emplace(m.partners());
    if (is_new) of_pair->second = areasOf(m.partners());
    const std::size_t a = of_pair->second.at(m.side[0][0]);
    const std::size_t b = m.side[1].empty() ? a : of_pair->second.at(m.side[1][0]);
    const auto next = static_cast<std::uint32_t>(numbers.size());
    patches.push_back(
        numbers.emplace(std::make_tuple(m.partners(), std::min(a, b), std::max(a, b)), next).first->second);
  }
  return patches;
}

std::string patchProblem(const Outcome& outcome) {
  std::ostringstream text;
  const std::vector<std::uint32_t> truth = PatchOracle(outcome).patches();
  const std::size_t count = truth.empty() ? 0 : 1 + *std::max_element(truth.begin(), truth.end());
  if (outcome.patches.size() != count) {
    text << outcome.patches.size() << " patches instead of " << count;
    return text.str();
  }
  if (outcome.patch_of.size() != outcome.contacts.size()) return "patch_of has not one entry for each contact";
  std::vector<Patch> expected(count);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    Patch& patch = expected[truth[i]];
    if (i >= outcome.contacts.size()) {
      ++patch.crossings;
      patch.toc_lower = patch.toc_upper = 0;
      continue;
    }
    const Contact& c = outcome.contacts[i];
    if (outcome.patch_of[i] != truth[i]) {
      text << "contact " << i << " is in patch " << outcome.patch_of[i] << " instead of " << truth[i];
      return text.str();
    }
    ++patch.contacts;
    patch.certain += c.certainty == Certainty::CERTAIN;
    patch.initial += c.initial;
    patch.toc_lower = std::min(patch.toc_lower, c.toc_lower);
    patch.toc_upper = std::min(patch.toc_upper, c.toc_upper);
    patch.body = {std::min(c.body[0], c.body[1]), std::max(c.body[0], c.body[1])};
  }
  for (std::size_t p = 0; p < count; ++p) {
    const Patch &found = outcome.patches[p], &wanted = expected[p];
    if (found.contacts != wanted.contacts || found.certain != wanted.certain || found.initial != wanted.initial ||
        found.crossings != wanted.crossings || found.toc_lower != wanted.toc_lower ||
        found.toc_upper != wanted.toc_upper || (wanted.contacts > 0 && found.body != wanted.body) ||
        (wanted.contacts > 0 && found.earliest.toc_lower != wanted.toc_lower && wanted.crossings == 0)) {
      text << "patch " << p << " is not what its " << wanted.contacts << " contacts are";
      return text.str();
    }
  }
  return "";
}

std::string patchDifference(const Outcome& a, const Outcome& b) {
  if (a.patches.size() != b.patches.size()) return "another number of patches";
  if (a.patch_of != b.patch_of) return "patch_of differs";
  const auto values = [](const Patch& p) {
    return std::vector<double>{static_cast<double>(p.body[0]),
                               static_cast<double>(p.body[1]),
                               static_cast<double>(p.contacts),
                               static_cast<double>(p.certain),
                               static_cast<double>(p.initial),
                               static_cast<double>(p.crossings),
                               p.toc_lower,
                               p.toc_upper,
                               p.earliest.toc_lower,
                               static_cast<double>(p.earliest.vertex[0]),
                               p.area_m2,
                               p.centroid[0],
                               p.centroid[1],
                               p.centroid[2],
                               p.normal[0],
                               p.normal[1],
                               p.normal[2],
                               p.box.min[0],
                               p.box.max[2]};
  };
  for (std::size_t p = 0; p < a.patches.size(); ++p) {
    const auto x = values(a.patches[p]), y = values(b.patches[p]);
    if (std::memcmp(x.data(), y.data(), x.size() * sizeof x[0]) != 0) return "patch " + std::to_string(p) + " differs";
  }
  return "";
}

}  // namespace test
}  // namespace dccd
