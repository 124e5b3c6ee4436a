#include "stream/patch_tracker.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <type_traits>
#include <utility>

#include "dccd/new_contacts.h"
#include "dccd/tolerances.h"
#include "obstacle/burst.h"

namespace dccd {
namespace {

bool isOf(const std::array<std::uint16_t, 2>& partners, std::size_t body) {
  return body == PatchTracker::ALL || partners[0] == body || partners[1] == body;
}

}  // namespace

void PatchTracker::Trace::resize(std::size_t size) {
  spots.resize(size);
  known.resize(size);
  releaseBurst(spots);
  releaseBurst(known);
}

PatchEvent PatchTracker::eventOf(PatchEventKind kind, std::uint64_t id) const {
  const Living& living = living_.at(id);
  PatchEvent event;
  event.kind = kind;
  event.id = id;
  event.body = living.body;
  event.beginning = living.beginning;
  event.expected = !living.unexpected;
  return event;
}

void PatchTracker::seam(std::size_t body) {
  for (auto at = living_.begin(); at != living_.end();) {
    if (!isOf(at->second.body, body)) {
      ++at;
      continue;
    }
    if (!at->second.unexpected) cut_off_expected_[at->second.body] = followed_expectations_;
    waiting_.push_back(eventOf(PatchEventKind::ENDED, at->first));
    waiting_.back().from_ns = at->second.touched_ns;
    waiting_.back().to_ns = at->second.released_ns;  // known only where it had been let go before the seam
    at = living_.erase(at);
  }
  if (body == ALL) {
    trace_.resize(0);
    has_last_ = false;
    return;
  }
  std::swap(trace_, all_);
  trace_.resize(0);
  for (std::size_t i = 0; i < all_.spots.size(); ++i) {
    if (!isOf(all_.spots[i].body, body)) trace_.push(all_.spots[i], all_.known[i]);
  }
}

void PatchTracker::expect(const std::vector<Expectation>& expected) {
  if (expected == expected_) return;
  expected_ = expected;
  ++expectations_;
}

void PatchTracker::forget(Outcome& outcome) noexcept {
  static_assert(std::is_nothrow_default_constructible_v<TouchGraph> && std::is_nothrow_move_assignable_v<TouchGraph>);
  try {
    waiting_.insert(waiting_.end(), outcome.patch_events.begin(), outcome.patch_events.end());
    outcome.patch_events.clear();
    seam();
  } catch (const std::exception&) {
    // There is no memory for telling what has ended either.
  }
  living_.clear();
  trace_ = all_ = Trace();
  graph_ = TouchGraph();
  has_last_ = false;
}

void PatchTracker::tell(Outcome& outcome) {
  outcome.patch_events.insert(outcome.patch_events.begin(), waiting_.begin(), waiting_.end());
  waiting_.clear();
}

void PatchTracker::follow(const PatchMaker& found, double gap_s, Outcome& outcome) {
  takeBodies(outcome.step->bodies);
  std::swap(all_, trace_);
  merge(found.spots(), outcome);
  findParts(found, outcome);
  findNewVoxels(found, outcome);
  findNews();
  keepIdentities(outcome);
  begin(outcome);
  goOn(outcome);
  remember(gap_s, outcome);
  endWhatIsGone(outcome);
  name(outcome);
  tellNews(outcome);
  for (PatchEvent& event : outcome.patch_events) {
    const auto has_id = [&](const Patch& patch) { return patch.id == event.id; };
    const auto patch = std::find_if(outcome.patches.begin(), outcome.patches.end(), has_id);
    if (patch != outcome.patches.end()) event.patch = static_cast<std::uint32_t>(patch - outcome.patches.begin());
  }
  has_last_ = true;
  for (auto at = cut_off_expected_.begin(); at != cut_off_expected_.end();) {
    const bool seen = at->first[1] == OBSTACLE_BODY ? map_seen_ : mesh_seen_;
    at = seen ? cut_off_expected_.erase(at) : std::next(at);
  }
  followed_expectations_ = expectations_;
}

/// What lives on bodies that came, went or have another mesh ends. The rest stays; its vertices get their new numbers.
void PatchTracker::takeBodies(const std::vector<Body>& bodies) {
  std::vector<Index> begin;
  bool same = graph_.bodyCount() == bodies.size();
  for (std::size_t b = 0; b < graph_.bodyCount(); ++b) {
    begin.push_back(graph_.firstVertex(b));
    if (b < bodies.size() && graph_.sameMesh(b, bodies[b])) continue;
    same = false;
    seam(b);
  }
  if (same) return;
  graph_.setBodies(bodies);
  for (TouchGraph::Spot& spot : trace_.spots) {
    for (std::size_t side = 0; side < 2 && spot.vertex[side] != NO_INDEX; ++side) {
      const auto next = std::upper_bound(begin.begin(), begin.end(), spot.vertex[side]);
      const auto body = static_cast<std::size_t>(next - begin.begin()) - 1;
      spot.vertex[side] += graph_.firstVertex(body) - begin[body];
    }
  }
}

void PatchTracker::recognise(const PatchMaker& found, Outcome& outcome) {
  const std::vector<Body>& bodies = outcome.step->bodies;
  if (graph_.bodyCount() != bodies.size()) return;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (!graph_.sameMesh(b, bodies[b])) return;
  }
  all_.resize(0);
  all_ = trace_;
  merge(found.spots(), outcome);
  findParts(found, outcome);
  findNews();
  for (Part& part : parts_) part.id = part.before.empty() ? 0 : part.before.front();
  name(outcome);
}

/// The step's patches get the identities of their parts.
void PatchTracker::name(Outcome& outcome) const {
  for (std::size_t p = 0; p < outcome.patches.size(); ++p) {
    Patch& patch = outcome.patches[p];
    const Part& part = parts_[part_of_patch_[p]];
    patch.is_new = part.is_new && !patch.isExpected();
    if (part.id == 0) continue;
    const Living& living = living_.at(part.id);
    patch.id = part.id;
    patch.beginning = living.beginning;
    patch.began_from_ns = living.began_from_ns;
    patch.began_to_ns = living.began_to_ns;
  }
  outcome.tracked = true;
}

/// Of a part that is none of a living patch: a seam cut it off, or it was forgotten after a burst, while all of it was
/// expected, and now other things are.
bool PatchTracker::wasCutOffAsExpected(const Part& part) const {
  const auto is_expected = [&](const auto& one) { return !one.second.unexpected && one.second.body == part.body; };
  if (forgot_burst_ && expectsOtherwise() && std::any_of(living_.begin(), living_.end(), is_expected)) return true;
  const auto cut_off = cut_off_expected_.find(part.body);
  return cut_off != cut_off_expected_.end() && cut_off->second != expectations_;
}

/// A patch is news once: in the step in which something unexpected of it touches for the first time. What touched
/// already when it was first looked at is no news; what was expected until now is.
void PatchTracker::findNews() {
  for (Part& part : parts_) {
    const auto is_unexpected = [&](std::uint64_t id) { return living_.at(id).unexpected; };
    if (part.before.empty()) {
      part.is_new = part.isUnexpected() && (!part.unexpected_initial || wasCutOffAsExpected(part));
    } else if (expectsOtherwise()) {  // what was expected may be what no longer is, also beside what never was
      part.is_new = part.isUnexpected() && !std::all_of(part.before.begin(), part.before.end(), is_unexpected);
    } else {
      part.is_new = part.isUnexpected() && std::none_of(part.before.begin(), part.before.end(), is_unexpected);
    }
  }
}

/// The event UNEXPECTED, for patches that began in an earlier step and of which all was expected until now.
void PatchTracker::tellNews(Outcome& outcome) const {
  for (const Part& part : parts_) {
    if (!part.is_new || part.before.empty()) continue;
    outcome.patch_events.push_back(eventOf(PatchEventKind::UNEXPECTED, part.id));
    PatchEvent& event = outcome.patch_events.back();
    for (const Patch& patch : outcome.patches) {
      if (patch.id != part.id || !patch.is_new) continue;
      const StampNs from_ns = outcome.stampBefore(newsTocLower(patch));
      if (event.from_ns != UNKNOWN_NS && event.from_ns <= from_ns) continue;
      event.from_ns = from_ns;
      event.to_ns = outcome.stampAfter(patch.crossings > 0 ? 0 : patch.earliest.toc_upper);
    }
  }
}

/// How long ago something touched is told by clocks that stand still while nobody looks: a step that was cut short, or
/// had no map, does not make what it did not see any older.
void PatchTracker::goOn(const Outcome& outcome) {
  mesh_seen_ = outcome.complete && !outcome.cut;
  map_seen_ = mesh_seen_ && outcome.status != StepStatus::NO_MAP;
  const std::int64_t duration_ns = outcome.stamp_ns - outcome.start_ns;
  if (mesh_seen_) mesh_clock_ns_ += duration_ns;
  if (map_seen_) map_clock_ns_ += duration_ns;
}

/// Adds what touches in this step to the trace, which all_ is before, each pair of vertices once.
void PatchTracker::merge(const std::vector<PatchSpot>& spots, const Outcome& outcome) {
  // After a burst of contacts the trace would cost every later step as much, so it is forgotten early.
  const std::size_t kept = std::max(tolerance::TRACE_PER_SPOT * spots.size(), tolerance::TRACE_ALWAYS);
  forgot_burst_ = all_.spots.size() > kept;
  if (forgot_burst_) all_.resize(0);
  releaseBurst(before_);
  before_.resize(all_.spots.size());
  if (std::exchange(half_merged_, true)) last_at_.clear();
  last_at_.resize(graph_.vertexCount(), NO_INDEX);
  for (std::uint32_t i = 0; i < before_.size(); ++i) {
    before_[i] = std::exchange(last_at_[all_.spots[i].vertex[0]], i);
  }
  releaseBurst(current_);
  current_.assign(all_.spots.size(), NO_PATCH);
  for (const PatchSpot& spot : spots) {
    std::uint32_t at = last_at_[spot.vertex];
    while (at != NO_INDEX && all_.spots[at].vertex[1] != spot.across) at = before_[at];
    if (at == NO_INDEX) {
      at = static_cast<std::uint32_t>(all_.spots.size());
      TouchGraph::Spot& one = all_.spots.emplace_back();
      one.vertex = {spot.vertex, spot.across};
      one.body = outcome.patches[spot.patch].body;
      all_.known.emplace_back();
      before_.push_back(std::exchange(last_at_[spot.vertex], at));
      current_.push_back(NO_PATCH);
    }
    all_.spots[at].expected = spot.expected;
    current_[at] = spot.patch;
  }
  for (const TouchGraph::Spot& spot : all_.spots) last_at_[spot.vertex[0]] = NO_INDEX;
  half_merged_ = false;
}

/// Which parts that were none of a living patch touch, when the step begins, a voxel that the map before did not have.
/// Asked only where the map is another one than in the step before.
void PatchTracker::findNewVoxels(const PatchMaker& found, const Outcome& outcome) {
  if (last_map_ != outcome.obstacle && has_last_) {
    for (const PatchLeaf& leaf : found.leaves()) {
      Part& part = parts_[part_of_patch_[leaf.patch]];
      if (part.map_changed || !part.before.empty() || !leaf.initial) continue;
      part.map_changed = isNewOnMap(leaf, outcome);
    }
  }
  last_map_ = outcome.obstacle;
  last_map_pose_ = outcome.step->map.map_from_fixed;
}

bool PatchTracker::isNewOnMap(const PatchLeaf& leaf, const Outcome& outcome) const {
  if (!last_map_) return true;
  const double resolution_m = outcome.obstacle->resolution(), half = 0.5 * std::ldexp(resolution_m, leaf.level);
  const Vec3 center(voxelPlane(leaf.voxel.x, resolution_m) + half, voxelPlane(leaf.voxel.y, resolution_m) + half,
                    voxelPlane(leaf.voxel.z, resolution_m) + half);
  return last_map_->leafAt(last_map_pose_ * (outcome.step->map.map_from_fixed.inverse() * center)) == nullptr;
}

void PatchTracker::findParts(const PatchMaker& found, const Outcome& outcome) {
  releaseBurst(part_of_);
  releaseBurst(parts_);
  if (outcome.patches.empty()) {  // of what does not touch nobody asks what belongs together
    graph_.clear();               // what a burst made of it is given back
    parts_.assign(1, Part());
    part_of_.assign(all_.spots.size(), 0);
    return;
  }
  // Where all that touched still does, the patches of the step are the parts.
  const bool same = all_.spots.size() == found.spots().size();
  if (same) {
    part_of_ = current_;
  } else {
    graph_.clear();
    graph_.add(all_.spots.data(), all_.spots.data() + all_.spots.size());
    graph_.findPatches();
    part_of_.clear();
    graph_.forEach([&](const TouchGroup&, std::uint32_t first, std::uint32_t last, std::uint32_t part) {
      part_of_.insert(part_of_.end(), last - first, part);
    });
  }
  parts_.assign(same ? outcome.patches.size() : graph_.patchCount(), Part());
  part_of_patch_.assign(outcome.patches.size(), 0);
  for (std::size_t i = 0; i < current_.size(); ++i) {
    const std::uint32_t part = part_of_[i];
    const std::uint64_t id = all_.known[i].id;
    std::vector<std::uint64_t>& before = parts_[part].before;
    if (id != 0 && (before.empty() || before.back() != id)) before.push_back(id);
    if (current_[i] != NO_PATCH) part_of_patch_[current_[i]] = part;
  }
  for (std::size_t p = 0; p < outcome.patches.size(); ++p) {
    const Patch& patch = outcome.patches[p];
    Part& part = parts_[part_of_patch_[p]];
    part.body = patch.body;
    part.size += patch.contacts + patch.crossings;
    part.touches = true;
    part.toc_lower = std::min(part.toc_lower, patch.toc_lower);
    part.toc_upper = std::min(part.toc_upper, patch.toc_upper);
    part.initial = part.initial || patch.initial + patch.crossings > 0;
    part.unexpected_new = part.unexpected_new || found.unexpected()[p].is_new;
    part.unexpected_initial = part.unexpected_initial || found.unexpected()[p].is_initial;
  }
  for (Part& part : parts_) {
    std::sort(part.before.begin(), part.before.end());
    part.before.erase(std::unique(part.before.begin(), part.before.end()), part.before.end());
  }
}

/// Where a living patch has come apart, its largest part keeps the identity and the others get new ones. Where several
/// have become one part, the oldest identity stays.
void PatchTracker::keepIdentities(Outcome& outcome) {
  std::map<std::uint64_t, std::vector<Part*>> parts_of;
  for (Part& part : parts_) {
    if (!part.touches) continue;
    for (const std::uint64_t id : part.before) parts_of[id].push_back(&part);
  }
  std::map<Part*, std::vector<std::uint64_t>> kept_by;
  for (auto& [id, parts] : parts_of) {
    const auto largest =
        std::max_element(parts.begin(), parts.end(), [](const Part* a, const Part* b) { return a->size < b->size; });
    kept_by[*largest].push_back(id);
    if ((*largest)->id == 0) (*largest)->id = id;
  }
  for (auto& [id, parts] : parts_of) {
    std::vector<std::uint64_t> others;
    for (Part* part : parts) {
      if (part->id == 0) {
        part->id = next_id_++;
        living_[part->id] = living_.at(id);
      }
      if (std::find(kept_by[part].begin(), kept_by[part].end(), id) == kept_by[part].end()) others.push_back(part->id);
    }
    if (others.empty()) continue;
    outcome.patch_events.push_back(eventOf(PatchEventKind::SPLIT, id));
    outcome.patch_events.back().others = others;
  }
  for (Part& part : parts_) {
    const auto kept = kept_by.find(&part);
    if (kept == kept_by.end() || kept->second.size() < 2) continue;
    outcome.patch_events.push_back(eventOf(PatchEventKind::MERGED, part.id));
    outcome.patch_events.back().others.assign(kept->second.begin() + 1, kept->second.end());
  }
  for (PatchEvent& event : outcome.patch_events) {
    event.from_ns = outcome.start_ns;
    event.to_ns = outcome.stamp_ns;
  }
}

/// Parts that touch and were part of no living patch begin as new ones, numbered in the order of their first touches.
void PatchTracker::begin(Outcome& outcome) {
  std::vector<Part*> fresh;
  for (Part& part : parts_) {
    if (part.touches && part.id == 0) fresh.push_back(&part);
  }
  std::stable_sort(fresh.begin(), fresh.end(),
                   [](const Part* a, const Part* b) { return a->toc_lower < b->toc_lower; });
  outcome.patch_events.reserve(outcome.patch_events.size() + fresh.size());  // what lives is told of
  for (Part* part : fresh) {
    part->id = next_id_++;
    Living& living = living_[part->id];
    living.body = part->body;
    living.unexpected = part->unexpected_new || part->unexpected_initial;
    if (part->initial) {
      living.beginning = part->map_changed ? PatchBeginning::MAP_CHANGED : PatchBeginning::INITIAL;
      living.began_to_ns = outcome.start_ns;
    } else {
      living.began_from_ns = outcome.stampBefore(part->toc_lower);
      living.began_to_ns = outcome.stampAfter(part->toc_upper);
    }
    outcome.patch_events.push_back(eventOf(PatchEventKind::BEGAN, part->id));
    outcome.patch_events.back().from_ns = living.began_from_ns;
    outcome.patch_events.back().to_ns = living.began_to_ns;
  }
}

/// The step becomes the trace, without what has not touched for longer than the gap.
void PatchTracker::remember(double gap_s, const Outcome& outcome) {
  alive_.clear();
  std::vector<std::uint64_t> unexpected;  // of what does not touch now
  std::size_t kept = 0;
  for (std::size_t i = 0; i < current_.size(); ++i) {
    const TouchGraph::Spot& spot = all_.spots[i];
    // Numbers, not the whole: a copy of what was just written in parts would wait for it.
    std::uint64_t id = all_.known[i].id;
    std::int64_t last_ns = all_.known[i].last_ns;
    bool expected = spot.expected;
    const std::int64_t clock_ns = spot.body[1] == OBSTACLE_BODY ? map_clock_ns_ : mesh_clock_ns_;
    if (current_[i] != NO_PATCH) last_ns = clock_ns;
    if (static_cast<double>(clock_ns - last_ns) > gap_s * 1e9) continue;
    Part& part = parts_[part_of_[i]];
    if (part.touches) {
      id = part.id;
      // All of it is expected now: what was not, when other things were expected, is over.
      expected = expected || (expectsOtherwise() && !part.isUnexpected());
      part.lasts_unexpected = part.lasts_unexpected || !expected;
    } else {
      if (alive_.empty() || alive_.back() != id) alive_.push_back(id);
      if (!expected && (unexpected.empty() || unexpected.back() != id)) unexpected.push_back(id);
    }
    if (kept != i) all_.spots[kept] = spot;
    all_.spots[kept].expected = expected;
    all_.known[kept].id = id;
    all_.known[kept++].last_ns = last_ns;
  }
  all_.resize(kept);
  std::swap(all_, trace_);
  for (auto& [id, living] : living_) {
    const bool seen = living.body[1] == OBSTACLE_BODY ? map_seen_ : mesh_seen_;
    if (seen && living.released_ns == UNKNOWN_NS) living.released_ns = outcome.start_ns;
  }
  for (const Part& part : parts_) {
    if (!part.touches) continue;
    Living& living = living_.at(part.id);
    living.touched_ns = std::max(living.touched_ns, outcome.stampBefore(part.toc_lower));
    living.released_ns = UNKNOWN_NS;
    if (part.lasts_unexpected) unexpected.push_back(part.id);
    alive_.push_back(part.id);
  }
  std::sort(alive_.begin(), alive_.end());
  // What is gone stays what it was to its end.
  for (const std::uint64_t id : alive_) living_.at(id).unexpected = false;
  for (const std::uint64_t id : unexpected) living_.at(id).unexpected = true;
}

void PatchTracker::endWhatIsGone(Outcome& outcome) {
  std::vector<std::uint64_t> merged;
  for (const PatchEvent& event : outcome.patch_events) {
    if (event.kind == PatchEventKind::MERGED) merged.insert(merged.end(), event.others.begin(), event.others.end());
  }
  std::vector<PatchEvent> ends;
  ends.reserve(living_.size());
  outcome.patch_events.reserve(outcome.patch_events.size() + living_.size());  // what is gone is told of
  for (auto at = living_.begin(); at != living_.end();) {
    if (std::binary_search(alive_.begin(), alive_.end(), at->first)) {
      ++at;
      continue;
    }
    if (std::find(merged.begin(), merged.end(), at->first) == merged.end()) {
      ends.push_back(eventOf(PatchEventKind::ENDED, at->first));
      ends.back().from_ns = at->second.touched_ns;
      ends.back().to_ns = at->second.released_ns;
    }
    at = living_.erase(at);
  }
  outcome.patch_events.insert(outcome.patch_events.begin(), ends.begin(), ends.end());
}

}  // namespace dccd
