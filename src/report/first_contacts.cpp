#include "report/first_contacts.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "report/words.h"
#include "stream/quantile.h"

namespace dccd {
namespace {

StampNs stampAt(const Outcome& outcome, double toc, double (*round)(double)) {
  const double after_ns = toc * static_cast<double>(outcome.stamp_ns - outcome.start_ns);
  return std::min(outcome.stamp_ns, outcome.start_ns + static_cast<StampNs>(round(after_ns)));
}

double meanEdge(const Body& body) {
  double sum_m = 0;
  std::size_t count = 0;
  for (const Edge& edge : body.topology->edges()) {
    const double length_m = ((*body.t0)[edge[0]] - (*body.t0)[edge[1]]).norm();
    if (!std::isfinite(length_m)) continue;
    sum_m += length_m;
    ++count;
  }
  return count > 0 ? sum_m / static_cast<double>(count) : 0;
}

/// The error of the end that is further off, with its sign.
double errorMs(const TimeSpan& found, const TimeSpan& truth) {
  const double from_ns = static_cast<double>(found.from_ns - truth.from_ns);
  const double to_ns = static_cast<double>(found.to_ns - truth.to_ns);
  return 1e-6 * (std::abs(to_ns) > std::abs(from_ns) ? to_ns : from_ns);
}

void setErrors(const std::vector<double>& errors_ms, FirstErrors& errors) {
  std::vector<double> sizes;
  for (const double error : errors_ms) {
    sizes.push_back(std::abs(error));
    errors.early_ms = std::min(errors.early_ms, error);
    errors.late_ms = std::max(errors.late_ms, error);
  }
  errors.median_ms = quantile(sizes, 0.5);
  errors.p95_ms = quantile(sizes, 0.95);
}

FirstErrors vertexErrors(const RunRecord& run, const RunRecord& reference, StampNs end_ns) {
  FirstErrors errors;
  std::vector<double> errors_ms;
  for (std::size_t b = 0; b < std::min(run.bodies.size(), reference.bodies.size()); ++b) {
    const RunRecord::BodyRecord &mine = run.bodies[b], &truth = reference.bodies[b];
    if (!mine.comparable || !truth.comparable) continue;
    std::vector<Index> common;
    std::set_intersection(mine.vertices.begin(), mine.vertices.end(), truth.vertices.begin(), truth.vertices.end(),
                          std::back_inserter(common));
    const auto when = [&](const RunRecord::BodyRecord& body, Index v) -> const TimeSpan* {
      const auto first = body.first.find(v);
      return first != body.first.end() && first->second.from_ns <= end_ns ? &first->second : nullptr;
    };
    for (const Index v : common) {
      const TimeSpan *found = when(mine, v), *true_time = when(truth, v);
      errors.touched += true_time != nullptr;
      errors.missed += true_time && !found;
      errors.invented += found && !true_time;
      if (found && true_time) errors_ms.push_back(errorMs(*found, *true_time));
    }
  }
  setErrors(errors_ms, errors);
  return errors;
}

double distance(const Box& a, const Box& b) {
  return (a.min - b.max).cwiseMax(b.min - a.max).cwiseMax(Vec3::Zero().eval()).norm();
}

/// How far points of contact of one and the same touch may be apart in the two runs [m].
double reachOf(const RunRecord& run, const std::array<std::uint16_t, 2>& partners) {
  const auto edge = [&](std::uint16_t body) { return body < run.bodies.size() ? run.bodies[body].edge_m : 0; };
  if (partners[1] == OBSTACLE_BODY) return edge(partners[0]) + run.voxel_m;
  return std::min(edge(partners[0]), edge(partners[1]));
}

/// They touch in steps that overlap, at most `reach_m` apart.
bool meet(const PatchLife& a, const PatchLife& b, double reach_m) {
  std::size_t i = 0, j = 0;
  while (i < a.seen.size() && j < b.seen.size()) {
    const PatchLife::Seen &x = a.seen[i], &y = b.seen[j];
    const bool overlap = x.step.from_ns <= y.step.to_ns && y.step.from_ns <= x.step.to_ns;
    if (overlap && distance(x.box, y.box) <= reach_m) return true;
    ++(x.step.to_ns < y.step.to_ns ? i : j);
  }
  return false;
}

/// One patch of each run at most: those that begin nearest to each other first.
void matchPatches(const RunRecord& run, const RunRecord& reference, StampNs end_ns, RunErrors& errors) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> candidates;  // distance of their beginnings, truth, found
  std::vector<std::uint8_t> met(run.patches.size()), true_met(reference.patches.size());
  const auto counts = [&](const PatchLife& life) { return life.began.from_ns <= end_ns; };
  for (std::size_t t = 0; t < reference.patches.size(); ++t) {
    const PatchLife& truth = reference.patches[t];
    for (std::size_t f = 0; counts(truth) && f < run.patches.size(); ++f) {
      const PatchLife& found = run.patches[f];
      if (truth.body != found.body || !counts(found)) continue;
      if (!meet(truth, found, std::max(reachOf(run, truth.body), reachOf(reference, truth.body)))) continue;
      candidates.emplace_back(std::abs(errorMs(found.began, truth.began)), t, f);
      met[f] = true_met[t] = 1;
    }
  }
  std::sort(candidates.begin(), candidates.end());
  std::vector<std::uint8_t> taken(run.patches.size()), true_taken(reference.patches.size());
  std::vector<double> errors_ms;
  for (const auto& [apart, t, f] : candidates) {
    if (true_taken[t] || taken[f]) continue;
    true_taken[t] = taken[f] = 1;
    errors_ms.push_back(errorMs(run.patches[f].began, reference.patches[t].began));
  }
  for (std::size_t t = 0; t < reference.patches.size(); ++t) {
    const bool here = counts(reference.patches[t]);
    errors.patches.touched += here;
    errors.patches.missed += here && !true_met[t];
    errors.joined += true_met[t] && !true_taken[t];
  }
  for (std::size_t f = 0; f < run.patches.size(); ++f) {
    errors.patches.invented += counts(run.patches[f]) && !met[f];
    errors.parted += met[f] && !taken[f];
  }
  setErrors(errors_ms, errors.patches);
}

}  // namespace

void RunRecorder::add(const Outcome& outcome) {
  if (!outcome.answered) return;
  ++record_.steps;
  record_.ms += outcome.stats.total_ms;
  record_.duration_s += outcome.duration_s();
  record_.end_ns = outcome.stamp_ns;
  record_.pairs += outcome.stats[Stage::ELEMENTARY].in + outcome.stats[Stage::OBSTACLE].in;
  addMeshes(outcome);
  for (const Contact& contact : outcome.contacts) {
    const TimeSpan span{stampAt(outcome, contact.toc_lower, std::floor),
                        stampAt(outcome, contact.toc_upper, std::ceil)};
    forContactVertices(contact, [&](std::uint16_t body, Index v) {
      const auto [first, is_new] = record_.bodies.at(body).first.emplace(v, span);
      if (is_new) return;
      first->second.from_ns = std::min(first->second.from_ns, span.from_ns);
      first->second.to_ns = std::min(first->second.to_ns, span.to_ns);
    });
  }
  addPatches(outcome);
}

void RunRecorder::addMeshes(const Outcome& outcome) {
  const std::vector<Body>& bodies = outcome.step->bodies;
  const bool is_first = topologies_.empty();
  record_.bodies.resize(bodies.size());
  topologies_.resize(bodies.size());
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const std::shared_ptr<const Topology>& now = bodies[b].topology;
    RunRecord::BodyRecord& body = record_.bodies[b];
    if (is_first) {
      body.vertices = now->usedVertices();
      body.edge_m = meanEdge(bodies[b]);
    } else if (now != topologies_[b]) {
      body.comparable = body.comparable && *now == *topologies_[b];
    }
    topologies_[b] = now;
  }
  if (record_.voxel_m > 0 || !outcome.obstacle || outcome.obstacle->leafCount() == 0) return;
  const std::vector<OccupiedLeaf>& leaves = outcome.obstacle->leaves();
  const auto smallest = std::min_element(leaves.begin(), leaves.end(),
                                         [](const OccupiedLeaf& a, const OccupiedLeaf& b) { return a.size < b.size; });
  record_.voxel_m = smallest->size * outcome.obstacle->resolution();
}

void RunRecorder::addPatches(const Outcome& outcome) {
  const auto originOf = [&](std::uint64_t id) {
    const auto parent = came_off_.find(id);
    return parent == came_off_.end() ? id : parent->second;
  };
  for (const PatchEvent& event : outcome.patch_events) {
    if (event.kind != PatchEventKind::SPLIT) continue;
    for (const std::uint64_t other : event.others) came_off_.emplace(other, originOf(event.id));
  }
  for (const Patch& patch : outcome.patches) {
    const auto [place, is_new] = place_of_.emplace(originOf(patch.id), record_.patches.size());
    if (is_new) {
      const bool known = patch.began_from_ns != UNKNOWN_NS;
      record_.patches.push_back({patch.body, {known ? patch.began_from_ns : patch.began_to_ns, patch.began_to_ns}, {}});
    }
    std::vector<PatchLife::Seen>& seen = record_.patches[place->second].seen;
    const TimeSpan step{outcome.start_ns, outcome.stamp_ns};
    if (seen.empty() || seen.back().step.to_ns != step.to_ns) seen.push_back({step, Box()});
    seen.back().box.min = seen.back().box.min.cwiseMin(patch.box.min);
    seen.back().box.max = seen.back().box.max.cwiseMax(patch.box.max);
  }
}

RunRecord RunRecorder::take() { return std::move(record_); }

RunErrors errorsOf(const RunRecord& run, const RunRecord& reference) {
  const StampNs end_ns = std::min(run.end_ns, reference.end_ns);
  RunErrors errors;
  errors.vertices = vertexErrors(run, reference, end_ns);
  matchPatches(run, reference, end_ns, errors);
  errors.pairs_share = reference.pairs > 0 ? static_cast<double>(run.pairs) / static_cast<double>(reference.pairs) : 1;
  return errors;
}

}  // namespace dccd
