#include "support/patch_oracle.h"

#include <algorithm>
#include <cstring>
#include <functional>
#include <map>
#include <numeric>
#include <sstream>

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
      m.side[side].push_back({c.body[side], c.vertex[i]});
    }
    members_.push_back(m);
  }
  std::vector<StartIntersection> crossings = outcome.intersections;
  std::sort(crossings.begin(), crossings.end(),
            [](const auto& a, const auto& b) { return std::tie(a.body, a.vertex) < std::tie(b.body, b.vertex); });
  for (const StartIntersection& s : crossings) {
    if (s.vertex[4] == NO_INDEX) continue;
    Member m;
    std::copy_n(s.body.begin(), 2, m.body);
    for (int i = 0; i < 5; ++i) m.side[i < 2 ? 0 : 1].push_back({s.body[i < 2 ? 0 : 1], s.vertex[i]});
    members_.push_back(m);
  }
}

bool PatchOracle::share(const std::vector<Vertex>& a, const std::vector<Vertex>& b) const {
  for (const Vertex& x : a) {
    for (const Vertex& y : b) {
      if (x.body == y.body && x.vertex == y.vertex) return true;
    }
  }
  return false;
}

bool PatchOracle::near(const std::vector<Vertex>& a, const std::vector<Vertex>& b) const {
  if (share(a, b)) return true;
  for (const Vertex& x : a) {
    const auto& ends = joined_[x.body][x.vertex];
    for (const Vertex& y : b) {
      if (x.body == y.body && std::find(ends.begin(), ends.end(), y.vertex) != ends.end()) return true;
    }
  }
  return false;
}

bool PatchOracle::neighbours(const Member& a, const Member& b) const {
  if ((a.body[1] == OBSTACLE_BODY) != (b.body[1] == OBSTACLE_BODY)) return false;
  if (a.body[1] == OBSTACLE_BODY) return near(a.side[0], b.side[0]);
  for (int turn = 0; turn < 2; ++turn) {
    const auto &one = b.side[turn], &other = b.side[1 - turn];
    if (share(a.side[0], one) && near(a.side[1], other)) return true;
    if (near(a.side[0], one) && share(a.side[1], other)) return true;
  }
  return false;
}

std::vector<std::uint32_t> PatchOracle::patches(bool by_vertex) const {
  std::vector<std::size_t> parent(members_.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const std::function<std::size_t(std::size_t)> root = [&](std::size_t i) {
    while (parent[i] != i) i = parent[i];
    return i;
  };
  const auto look = [&](std::size_t i, std::size_t j) {
    const std::size_t a = root(i), b = root(j);
    if (a != b && neighbours(members_[i], members_[j])) parent[std::max(a, b)] = std::min(a, b);
  };
  if (by_vertex) {
    std::map<std::pair<std::uint16_t, Index>, std::vector<std::size_t>> at;
    std::vector<std::size_t> map;
    for (std::size_t i = 0; i < members_.size(); ++i) {
      for (const auto& side : members_[i].side) {
        for (const Vertex& v : side) at[{v.body, v.vertex}].push_back(i);
      }
      if (members_[i].body[1] == OBSTACLE_BODY) map.push_back(i);
    }
    for (const auto& [vertex, list] : at) {
      for (const std::size_t i : list) {
        for (const std::size_t j : list) look(i, j);
      }
    }
    for (const std::size_t i : map) {
      for (const std::size_t j : map) look(i, j);
    }
  } else {
    for (std::size_t i = 0; i < members_.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) look(i, j);
    }
  }
  std::vector<std::uint32_t> numbers(members_.size());
  std::uint32_t count = 0;
  for (std::size_t i = 0; i < members_.size(); ++i) {
    const std::size_t r = root(i);
    numbers[i] = r == i ? count++ : numbers[r];
  }
  return numbers;
}

std::string patchProblem(const Outcome& outcome, bool by_vertex) {
  std::ostringstream text;
  const std::vector<std::uint32_t> truth = PatchOracle(outcome).patches(by_vertex);
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
