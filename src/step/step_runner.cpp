#include "step/step_runner.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "step/pair_worker.h"

namespace dccd {

namespace {

double rotationAngle(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  const Eigen::Quaterniond turn(a.linear().transpose() * b.linear());
  return 2 * std::atan2(turn.vec().norm(), std::abs(turn.w()));
}

void add(const StepStats& part, StepStats& sum) {
  for (std::size_t i = 0; i < sum.stages.size(); ++i) sum.stages[i] += part.stages[i];
  for (std::size_t i = 0; i < sum.effects.size(); ++i) sum.effects[i] += part.effects[i];
  sum.tiers += part.tiers;
  sum.total_ms += part.total_ms;
  sum.vf_candidates += part.vf_candidates;
  sum.ee_candidates += part.ee_candidates;
  sum.undecided += part.undecided;
  sum.initial += part.initial;
  sum.leaving += part.leaving;
  sum.unfolded_bodies += part.unfolded_bodies;
  sum.bodies_refitted += part.bodies_refitted;
  sum.bodies_kept += part.bodies_kept;
  sum.body_pairs += part.body_pairs;
  sum.left_out_met += part.left_out_met;
  // The same in every part.
  sum.left_out_listed = std::max(sum.left_out_listed, part.left_out_listed);
  sum.unchecked_vertices = std::max(sum.unchecked_vertices, part.unchecked_vertices);
  sum.unchecked_faces = std::max(sum.unchecked_faces, part.unchecked_faces);
}

bool samePair(const Contact& a, const Contact& b) {
  return a.kind == b.kind && a.body == b.body && a.vertex == b.vertex && a.voxel == b.voxel;
}

/// The same pair in two parts of a step is one contact: it begins in the earlier part, and is certain if it is in
/// either.
void join(Contact& into, const Contact& later) {
  if (later.certainty != Certainty::CERTAIN || into.certainty == Certainty::CERTAIN) return;
  into.certainty = Certainty::CERTAIN;
  into.toc_upper = later.toc_upper;
}

/// toc of part i of n as a fraction of the whole step. The division is rounded, so one step outwards.
double scaleDown(double toc, std::size_t i, std::size_t n) {
  return n == 1 ? toc : std::max(0.0, std::nextafter((static_cast<double>(i) + toc) / static_cast<double>(n), 0.0));
}
double scaleUp(double toc, std::size_t i, std::size_t n) {
  return n == 1 ? toc : std::min(1.0, std::nextafter((static_cast<double>(i) + toc) / static_cast<double>(n), 2.0));
}

ContactCounts countsOf(const std::vector<Contact>& contacts) {
  ContactCounts counts;
  for (const Contact& contact : contacts) {
    ++(contact.certainty == Certainty::CERTAIN ? counts.certain : counts.undecided);
    ++(contact.body[1] == OBSTACLE_BODY ? counts.obstacle : counts.mesh);
    counts.initial += contact.initial;
    counts.leaving += contact.leaving;
  }
  return counts;
}

void keepEarliest(std::size_t count, std::vector<Contact>& contacts) {
  if (contacts.size() <= count) return;
  std::stable_sort(contacts.begin(), contacts.end(),
                   [](const Contact& a, const Contact& b) { return a.toc_lower < b.toc_lower; });
  contacts.resize(count);
  std::sort(contacts.begin(), contacts.end(), canonicalLess);
}

/// What of the raw contacts is reported, and what the step may be called.
void conclude(const MonitorOptions& options, StepOutcome& outcome) {
  auto& contacts = outcome.contacts;
  const bool touched = !contacts.empty();
  if (options.suppress_initial) {
    const auto kept = std::remove_if(contacts.begin(), contacts.end(),
                                     [](const Contact& c) { return c.initial && c.body[1] == OBSTACLE_BODY; });
    outcome.suppressed = static_cast<std::size_t>(contacts.end() - kept);
    contacts.erase(kept, contacts.end());
  }
  outcome.total_contacts = contacts.size();
  outcome.counts = countsOf(contacts);
  outcome.earliest_toc = outcome.unchecked_toc_lower;
  for (const auto& contact : contacts) outcome.earliest_toc = std::min(outcome.earliest_toc, contact.toc_lower);
  keepEarliest(options.max_contacts, contacts);

  outcome.status = StepStatus::OK;
  if (outcome.stats.unchecked_vertices > 0) {
    outcome.status = StepStatus::PARTIAL;
    outcome.reason = std::to_string(outcome.stats.unchecked_vertices) + " vertices are not finite and were not checked";
  }
  if (contacts.size() < outcome.total_contacts) {
    outcome.status = StepStatus::TRUNCATED;
    outcome.reason = "the earliest " + std::to_string(contacts.size()) + " of " +
                     std::to_string(outcome.total_contacts) + " contacts are listed";
  }
  if (!outcome.complete) {
    outcome.status = StepStatus::DEADLINE;
    outcome.reason = std::isfinite(outcome.unchecked_toc_lower)
                         ? "the step budget ran out; nothing that was left out touches before toc " +
                               std::to_string(outcome.unchecked_toc_lower)
                         : "the step budget ran out before all of the start state was looked at; no pair was left out "
                           "of the contacts";
  }
  outcome.answered = true;
  outcome.clear = outcome.status == StepStatus::OK && outcome.start_state == StartState::CLEAR && !touched;
}

}  // namespace

void StepInput::resize(std::size_t bodies) {
  t0.resize(bodies);
  t1.resize(bodies);
  topologies.resize(bodies);
  rigid.resize(bodies, 0);
  pose_t0.resize(bodies, Eigen::Isometry3d::Identity());
  pose_t1.resize(bodies, Eigen::Isometry3d::Identity());
  radius_m.resize(bodies);
  references.resize(bodies);
}

std::size_t requiredSubsteps(const StepInput& input, double tolerance_m) {
  double parts = 1;
  for (std::size_t b = 0; b < input.t0.size(); ++b) {
    if (!input.rigid[b]) continue;
    const double angle = input.pose_scale * rotationAngle(input.pose_t0[b], input.pose_t1[b]);
    double radius = 0;
    for (const Vec3& p : input.t0[b]) radius = std::max(radius, (p - input.pose_t0[b].translation()).norm());
    // A chord leaves its arc by radius (1 - cos(angle / 2)) at most, which is the whole diameter from a full turn on.
    if (radius * (1 - std::cos(std::min(angle, M_PI) / 2)) <= tolerance_m) continue;
    parts = std::max(parts, std::ceil(angle / (2 * std::acos(1 - tolerance_m / radius))));
  }
  return parts < 1e9 ? static_cast<std::size_t>(parts) : static_cast<std::size_t>(1e9);
}

namespace {

/// What moves a rigid body from t0 to where it is at the fraction u of the step.
Eigen::Isometry3d movedBy(const StepInput& input, std::size_t body, double u) {
  return interpolate(input.pose_t0[body], input.pose_t1[body], u * input.pose_scale) * input.pose_t0[body].inverse();
}

}  // namespace

void placeAt(const StepInput& input, std::size_t part, std::size_t parts, std::vector<Positions>& out) {
  const double u = static_cast<double>(part) / static_cast<double>(parts);
  out.resize(input.t0.size());
  for (std::size_t b = 0; b < input.t0.size(); ++b) {
    if (!input.rigid[b] || part == 0 || part == parts) {
      interpolate(input.t0[b], input.t1[b], u, out[b]);
      continue;
    }
    const Eigen::Isometry3d moved = movedBy(input, b, u);
    out[b].resize(input.t0[b].size());
    for (std::size_t v = 0; v < out[b].size(); ++v) out[b][v] = moved * input.t0[b][v];
  }
}

Vec3 placeVertex(const StepInput& input, std::size_t body, Index vertex, std::size_t part, std::size_t parts) {
  const Vec3 &from = input.t0[body][vertex], &to = input.t1[body][vertex];
  if (part == 0 || part == parts) return part == 0 ? from : to;
  const double u = static_cast<double>(part) / static_cast<double>(parts);
  return input.rigid[body] ? Vec3(movedBy(input, body, u) * from) : Vec3(from + u * (to - from));
}

StepRunner::StepRunner(const DetectorOptions& options) : detector_(options) {}

void StepRunner::setOptions(const DetectorOptions& options) { detector_.setOptions(options); }

std::vector<BodySetup> bodySetups(const StepInput& input, const std::vector<MonitorBody>& bodies) {
  std::vector<BodySetup> setups;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const MonitorBody& body = bodies[b];
    BodySetup setup{body.name,
                    input.topologies[b],
                    body.self_collision && !body.rigid,
                    body.against_bodies,
                    body.against_obstacle,
                    body.minimum_separation_m,
                    {},
                    body.separations,
                    input.references[b],
                    body.rigid};
    if (!body.vertex_mask.empty()) setup.vertex_active.assign(input.topologies[b]->vertexCount(), 1);
    for (const Index v : body.vertex_mask) {
      if (v >= setup.vertex_active.size()) {
        throw std::invalid_argument("vertex_mask of body '" + body.name + "' names vertex " + std::to_string(v) +
                                    ", but the mesh has " + std::to_string(setup.vertex_active.size()));
      }
      setup.vertex_active[v] = 0;
    }
    setups.push_back(std::move(setup));
  }
  return setups;
}

void StepRunner::setBodies(const StepInput& input, const std::vector<MonitorBody>& bodies) {
  std::vector<const Positions*> rest;
  for (const Positions& positions : input.t0) rest.push_back(&positions);
  detector_.setBodies(bodySetups(input, bodies), rest);
  set_topologies_ = input.topologies;
  set_references_ = input.references;
}

void StepRunner::runPart(const StepInput& at, bool continues, std::size_t part, std::size_t parts,
                         StepOutcome& outcome) {
  step_.bodies.resize(at.t0.size());
  for (std::size_t b = 0; b < at.t0.size(); ++b) {
    step_.bodies[b] = {&at.t0[b], &at.t1[b], at.radius_m[b].empty() ? nullptr : &at.radius_m[b]};
  }
  step_.continues = continues;
  step_.spent_ms = outcome.stats.total_ms;  // the budget is one for the whole step
  step_.parts_after = parts - part - 1;
  step_.start_state_wanted = part == 0 || !aside_;
  const StepResult& result = detector_.run(step_);
  if (part == 0) {
    outcome.start_state = result.start_state;
    outcome.complete = outcome.complete && result.start_state_complete;
    outcome.intersections = result.intersections;
  }
  for (Contact contact : result.contacts) {
    contact.toc_lower = scaleDown(contact.toc_lower, part, parts);
    contact.toc_upper = scaleUp(contact.toc_upper, part, parts);
    contact.initial = contact.initial && part == 0;
    outcome.contacts.push_back(contact);
  }
  if (!result.complete) {
    outcome.complete = false;
    outcome.unchecked_toc_lower =
        std::min(outcome.unchecked_toc_lower, scaleDown(std::min(result.unchecked_toc_lower, 1.0), part, parts));
  }
  add(result.stats, outcome.stats);
}

bool StepRunner::budgetIsSpent(const StepOutcome& outcome) const {
  const double budget_ms = detector_.options().step_budget_ms;
  return budget_ms > 0 && outcome.stats.total_ms >= budget_ms;
}

bool StepRunner::runParts(const StepInput& input, const MonitorMap& map, bool continues, std::size_t parts,
                          StepOutcome& outcome) {
  step_.obstacle = map.surface;
  step_.map_from_fixed = map.map_from_fixed;
  if (parts == 1) {
    runPart(input, continues, 0, 1, outcome);
    return true;
  }
  bool reached_end = true;
  part_.resize(input.t0.size());
  part_.t1 = input.t0;
  part_.radius_m = input.radius_m;
  for (std::size_t i = 0; i < parts; ++i) {
    if (i > 0 && budgetIsSpent(outcome)) {
      // Of the rest all that is known is that it has not begun yet.
      outcome.complete = false;
      outcome.unchecked_toc_lower = std::min(outcome.unchecked_toc_lower, scaleDown(0, i, parts));
      reached_end = false;
      break;
    }
    const Clock::time_point start = Clock::now();
    part_.t0.swap(part_.t1);
    placeAt(input, i + 1, parts, part_.t1);
    const double place_ms = msSince(start);
    outcome.stats[Effect::RIGID_BODIES].ms += place_ms;
    outcome.stats.total_ms += place_ms;
    runPart(part_, i > 0 || continues, i, parts, outcome);
  }
  auto& contacts = outcome.contacts;
  std::stable_sort(contacts.begin(), contacts.end(), canonicalLess);  // of one pair, the earlier part stays first
  std::size_t kept = 0;
  for (const Contact& contact : contacts) {
    if (kept > 0 && samePair(contacts[kept - 1], contact)) {
      join(contacts[kept - 1], contact);
    } else {
      contacts[kept++] = contact;
    }
  }
  contacts.resize(kept);
  return reached_end;
}

void StepRunner::run(const StepInput& input, const std::vector<MonitorBody>& bodies, const MonitorOptions& options,
                     const MonitorMap& map, bool continues, StepOutcome& outcome, StepRunner* predecessor) {
  if (set_topologies_ != input.topologies || set_references_ != input.references) {
    setBodies(input, bodies);
    continues = false;
  }
  // The detector knows what is where at the end of the last part that it was given.
  continues = continues && reached_end_;
  reached_end_ = false;  // also when it throws
  const std::size_t wanted = requiredSubsteps(input, options.rigid_tolerance_m);
  const std::size_t parts = std::min(wanted, options.max_substeps);
  outcome.substeps = parts;
  outcome.obstacle = map.surface;
  outcome.map_from_fixed = map.map_from_fixed;
  outcome.map_stamp_ns = map.stamp_ns;
  step_.predecessor = predecessor && predecessor->reached_end_ ? &predecessor->detector_ : nullptr;
  aside_ = predecessor != nullptr;
  reached_end_ = runParts(input, map, continues, parts, outcome);
  outcome.input = &input;
  outcome.positions_t0 = &input.t0;
  outcome.positions_t1 = &input.t1;
  outcome.topologies = &input.topologies;
  conclude(options, outcome);
  if (parts < wanted) {
    outcome.status = StepStatus::PARTIAL;
    outcome.clear = false;
    outcome.reason = "a rigid body turns so far that " + std::to_string(wanted) +
                     " parts are needed; max_substeps is " + std::to_string(parts);
  }
}

}  // namespace dccd
