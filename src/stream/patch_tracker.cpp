#include "stream/patch_tracker.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <type_traits>
#include <utility>

#include "dccd/monitor_extras.h"
#include "dccd/tolerances.h"
#include "obstacle/burst.h"

namespace dccd {
namespace {

bool isOf(const std::array<std::uint16_t, 2>& partners, std::size_t body) {
  return body == PatchTracker::ALL || partners[0] == body || partners[1] == body;
}

}  // namespace

std::uint32_t PatchTracker::Trace::at(Index vertex, Index across, const std::array<std::uint16_t, 2>& body) {
  std::uint32_t& last = last_at[vertex];
  for (std::uint32_t i = last; i != NO_INDEX; i = before[i]) {
    if (spots[i].vertex[1] == across) return i;
  }
  TouchGraph::Spot& spot = spots.emplace_back();
  spot.vertex = {vertex, across};
  spot.body = body;
  known.emplace_back();
  before.push_back(last);
  joined_parts = 0;
  return last = static_cast<std::uint32_t>(spots.size() - 1);
}

template <class F>
void PatchTracker::Trace::keep(const F& isKept) {
  std::size_t kept = 0;
  while (kept < size() && isKept(spots[kept], known[kept])) ++kept;
  if (kept == size()) return;
  joined_parts = 0;
  for (std::size_t i = size(); i-- > kept;) last_at[spots[i].vertex[0]] = before[i];
  for (std::size_t i = kept + 1; i < size(); ++i) {
    if (!isKept(spots[i], known[i])) continue;
    spots[kept] = spots[i];
    known[kept] = known[i];
    before[kept] = std::exchange(last_at[spots[i].vertex[0]], static_cast<std::uint32_t>(kept));
    ++kept;
  }
  const auto shorten = [kept](auto&... buffers) { ((buffers.resize(kept), releaseBurst(buffers)), ...); };
  shorten(spots, known, before, part_of);
}

void PatchTracker::Trace::clear() {
  keep([](const TouchGraph::Spot&, const Known&) { return false; });
}

void PatchTracker::Trace::numberVertices(std::size_t count) {
  last_at.assign(count, NO_INDEX);
  for (std::uint32_t i = 0; i < size(); ++i) before[i] = std::exchange(last_at[spots[i].vertex[0]], i);
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
  trace_.keep([&](const TouchGraph::Spot& spot, const Known&) { return !isOf(spot.body, body); });
  for (std::size_t b = 0; b < looks_.size(); ++b) {
    if (body == ALL || b == body) looks_[b] = {};
  }
  if (body == ALL) has_last_ = false;
}

void PatchTracker::expect(const std::vector<Expectation>& expected) {
  if (expected == expected_) return;
  expected_ = expected;
  ++expectations_;
}

void PatchTracker::forget(Outcome& outcome) noexcept {
  static_assert(std::is_nothrow_default_constructible_v<TouchGraph> && std::is_nothrow_move_assignable_v<TouchGraph>);
  trace_ = all_ = Trace();
  try {
    waiting_.insert(waiting_.end(), outcome.patch_events.begin(), outcome.patch_events.end());
    outcome.patch_events.clear();
    seam();
  } catch (const std::exception&) {
    // There is no memory for telling what has ended either.
  }
  living_.clear();
  graph_ = TouchGraph();
  has_last_ = false;
}

void PatchTracker::tell(Outcome& outcome) {
  outcome.patch_events.insert(outcome.patch_events.begin(), waiting_.begin(), waiting_.end());
  waiting_.clear();
}

void PatchTracker::follow(const PatchMaker& found, double gap_s, Outcome& outcome) {
  takeBodies(outcome.step->bodies);
  goOn(outcome);
  std::swap(all_, trace_);
  merge(found.spots(), outcome);
  findParts(found, outcome);
  findNewVoxels(found, outcome);
  findApart(outcome);
  findNews();
  keepIdentities(outcome);
  begin(outcome);
  remember(gap_s, outcome);
  rememberLook(outcome);
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
    at = clockOf(at->first).sees ? cut_off_expected_.erase(at) : std::next(at);
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
  looks_.resize(bodies.size());
  if (same) return;
  graph_.setBodies(bodies);
  for (TouchGraph::Spot& spot : trace_.spots) {
    for (std::size_t side = 0; side < 2 && spot.vertex[side] != NO_INDEX; ++side) {
      const auto next = std::upper_bound(begin.begin(), begin.end(), spot.vertex[side]);
      const auto body = static_cast<std::size_t>(next - begin.begin()) - 1;
      spot.vertex[side] += graph_.firstVertex(body) - begin[body];
    }
  }
  trace_.numberVertices(graph_.vertexCount());
}

void PatchTracker::recognise(const PatchMaker& found, Outcome& outcome) {
  const std::vector<Body>& bodies = outcome.step->bodies;
  if (graph_.bodyCount() != bodies.size()) return;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (!graph_.sameMesh(b, bodies[b])) return;
  }
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
/// already when it was first looked at is no news; what was seen apart before, or was expected until now, is.
void PatchTracker::findNews() {
  for (Part& part : parts_) {
    const auto is_unexpected = [&](std::uint64_t id) { return living_.at(id).unexpected; };
    if (part.before.empty()) {
      const bool began = !part.unexpected_initial || part.apart_ns != UNKNOWN_NS;
      part.is_new = part.isUnexpected() && (began || wasCutOffAsExpected(part));
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
  mesh_clock_.sees = outcome.complete && !outcome.cut;
  map_clock_.sees = mesh_clock_.sees && outcome.status != StepStatus::NO_MAP;
  for (Clock* const clock : {&mesh_clock_, &map_clock_}) {
    if (clock->sees) clock->now_ns += outcome.stamp_ns - outcome.start_ns;
  }
}

/// Adds what touches in this step to the trace, which all_ is before, each pair of vertices once. What is too old goes
/// first; where nothing touches nobody asks for it, and it stays.
void PatchTracker::merge(const std::vector<PatchSpot>& spots, const Outcome& outcome) {
  // After a burst of contacts the trace would cost every later step as much, so it is forgotten early.
  const std::size_t most = std::max(tolerance::TRACE_PER_SPOT * spots.size(), tolerance::TRACE_ALWAYS);
  if (!spots.empty() || all_.size() > most) {
    all_.keep([&](const TouchGraph::Spot& spot, const Known& known) { return lasts(spot.body, known.last_ns); });
  }
  forgot_burst_ = all_.size() > most;
  if (forgot_burst_) all_.clear();
  old_ = all_.size();
  releaseBurst(at_);
  at_.clear();
  for (const PatchSpot& spot : spots) {
    const std::array<std::uint16_t, 2>& body = outcome.patches[spot.patch].body;
    const std::uint32_t at = all_.at(spot.vertex, spot.across, body);
    all_.spots[at].expected = spot.expected;
    all_.known[at].last_ns = clockOf(body).now_ns;
    at_.push_back(at);
  }
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
  last_map_pose_ = outcome.step->map.fromFixedAt(1);
}

bool PatchTracker::isNewOnMap(const PatchLeaf& leaf, const Outcome& outcome) const {
  if (!last_map_) return true;
  const double resolution_m = outcome.obstacle->resolution(), half = 0.5 * std::ldexp(resolution_m, leaf.level);
  const Vec3 center(voxelPlane(leaf.voxel.x, resolution_m) + half, voxelPlane(leaf.voxel.y, resolution_m) + half,
                    voxelPlane(leaf.voxel.z, resolution_m) + half);
  return last_map_->leafAt(last_map_pose_ * (outcome.step->map.map_from_fixed.inverse() * center)) == nullptr;
}

/// When parts that were none of a living patch were seen apart: since then no frames began anew, no voxel came, and
/// nothing static was put elsewhere. So they came to touch, be it in a step that was cut or as noise grew.
void PatchTracker::findApart(const Outcome& outcome) {
  const std::vector<Body>& bodies = outcome.step->bodies;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (bodies[b].motion == BodyMotionKind::STATIC && bodies[b].t0 != looks_[b].at_rest) looks_[b] = {};
  }
  if (forgot_burst_) return;
  for (Part& part : parts_) {
    if (!part.touches || !part.before.empty() || part.map_changed) continue;
    const auto [a, b] = part.body;
    part.apart_ns = b == OBSTACLE_BODY ? looks_[a].map_ns : std::min(looks_[a].bodies_ns, looks_[b].bodies_ns);
  }
}

void PatchTracker::rememberLook(const Outcome& outcome) {
  const bool all = outcome.stats.unchecked_vertices + outcome.stats.unchecked_faces == 0;
  for (std::size_t b = 0; b < looks_.size(); ++b) {
    if (outcome.step->bodies[b].motion == BodyMotionKind::STATIC) looks_[b].at_rest = outcome.step->bodies[b].t1;
    if (all && mesh_clock_.sees) looks_[b].bodies_ns = outcome.stamp_ns;
    if (all && map_clock_.sees) looks_[b].map_ns = outcome.stamp_ns;
  }
}

void PatchTracker::findParts(const PatchMaker& found, const Outcome& outcome) {
  const std::vector<PatchSpot>& spots = found.spots();
  releaseBurst(parts_);
  parts_.clear();
  graph_.clear();             // what a burst made of it is given back
  if (spots.empty()) return;  // of what does not touch nobody asks what belongs together
  std::vector<std::uint32_t>& part_of = all_.part_of;
  if (spots.size() == all_.size()) {  // all that touched still does: the patches of the step are the parts
    part_of.resize(all_.size());
    for (std::size_t s = 0; s < spots.size(); ++s) part_of[at_[s]] = spots[s].patch;
    all_.joined_parts = 0;  // in another order than that of the spots
    parts_.resize(outcome.patches.size());
  } else {
    if (all_.joined_parts == 0) {
      graph_.add(all_.spots.data(), all_.spots.data() + all_.size());
      graph_.findPatches();
      part_of.clear();
      graph_.forEach([&](const TouchGroup&, std::uint32_t first, std::uint32_t last, std::uint32_t part) {
        part_of.insert(part_of.end(), last - first, part);
      });
      all_.joined_parts = graph_.patchCount();
    }
    parts_.resize(all_.joined_parts);
  }
  std::uint32_t last_part = NO_PATCH;
  std::uint64_t last_id = 0;
  for (std::size_t i = 0; i < old_; ++i) {
    const std::uint32_t part = part_of[i];
    const std::uint64_t id = all_.known[i].id;
    if (id == last_id && part == last_part) continue;
    parts_[last_part = part].before.push_back(last_id = id);
  }
  part_of_patch_.resize(outcome.patches.size());
  for (std::size_t s = 0; s < spots.size(); ++s) part_of_patch_[spots[s].patch] = part_of[at_[s]];
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
    if (part->initial && part->apart_ns != UNKNOWN_NS) {
      living.began_from_ns = std::min(part->apart_ns, outcome.start_ns);
      living.began_to_ns = outcome.start_ns;
    } else if (part->initial) {
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

/// The step becomes the trace.
void PatchTracker::remember(double gap_s, const Outcome& outcome) {
  const auto changes = [this](const Part& part) { return changesHands(part); };
  if (forgot_burst_ || std::any_of(parts_.begin(), parts_.end(), changes)) askAllSpots();
  for (std::size_t i = old_; i < all_.size(); ++i) all_.known[i].id = parts_[all_.part_of[i]].id;
  std::swap(all_, trace_);
  const auto gap_ns = static_cast<std::int64_t>(std::min(gap_s * 1e9, 0x1p62));
  for (Clock* const clock : {&mesh_clock_, &map_clock_}) {
    clock->kept_from_ns = std::max(clock->kept_from_ns, clock->now_ns - gap_ns);
  }
  for (auto& [id, living] : living_) {
    if (clockOf(living.body).sees && living.released_ns == UNKNOWN_NS) living.released_ns = outcome.start_ns;
  }
  for (const Part& part : parts_) {
    if (!part.touches) continue;
    Living& living = living_.at(part.id);
    living.touched_ns = std::max(living.touched_ns, outcome.stampBefore(part.toc_lower));
    living.released_ns = UNKNOWN_NS;
    living.last_ns = clockOf(part.body).now_ns;
    if (part.isUnexpected()) living.last_unexpected_ns = living.last_ns;
  }
  for (auto& [id, living] : living_) {
    if (lasts(living.body, living.last_ns)) living.unexpected = lasts(living.body, living.last_unexpected_ns);
  }
}

/// Do old spots of the part get another identity, or may what was not expected of them be so now?
bool PatchTracker::changesHands(const Part& part) const {
  const bool has_others = part.before.size() > 1 || (part.before.size() == 1 && part.before[0] != part.id);
  return part.touches && (has_others || !part.isUnexpected());
}

/// What is known of living patches is known anew, from each spot. In most steps remember() needs only what touches.
void PatchTracker::askAllSpots() {
  for (auto& [id, living] : living_) living.last_ns = living.last_unexpected_ns = NEVER;
  Living* living = nullptr;
  std::uint64_t last_id = 0;
  for (std::size_t i = 0; i < all_.size(); ++i) {
    TouchGraph::Spot& spot = all_.spots[i];
    Known& known = all_.known[i];
    const Part& part = parts_[all_.part_of[i]];
    if (part.touches) known.id = part.id;
    // All of it is expected now: what was not, when other things were expected, is over.
    if (part.touches && expectsOtherwise() && !part.isUnexpected()) spot.expected = true;
    if (known.id != last_id) living = &living_.at(last_id = known.id);
    living->last_ns = std::max(living->last_ns, known.last_ns);
    if (!spot.expected) living->last_unexpected_ns = std::max(living->last_unexpected_ns, known.last_ns);
  }
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
    if (lasts(at->second.body, at->second.last_ns)) {
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
  if (living_.empty()) trace_.clear();
  outcome.patch_events.insert(outcome.patch_events.begin(), ends.begin(), ends.end());
}

}  // namespace dccd
