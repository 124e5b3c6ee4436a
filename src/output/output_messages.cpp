#include "output/output_messages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/contact_fields.h"
#include "dccd/monitor_extras.h"
#include "output/clearance_messages.h"
#include "output/patch_messages.h"

namespace dccd {

namespace {

using ContactMessage = deformable_ccd::Contact;
using StatsMessage = deformable_ccd::StepStats;

constexpr std::size_t KEPT_FOR_USE = 4, ALWAYS_KEPT = 1024;  // times what is in use, which counts as so much

static_assert(static_cast<int>(StepStatus::OK) == static_cast<int>(deformable_ccd::ContactArray::OK));
static_assert(static_cast<int>(StepStatus::GAP) == static_cast<int>(deformable_ccd::ContactArray::GAP));
static_assert(static_cast<int>(StepStatus::NO_BODY) == static_cast<int>(deformable_ccd::ContactArray::NO_BODY));
static_assert(static_cast<int>(StepStatus::TRUNCATED) == static_cast<int>(deformable_ccd::ContactArray::TRUNCATED));
static_assert(static_cast<int>(StepStatus::VERTEX_COUNT) ==
              static_cast<int>(deformable_ccd::ContactArray::VERTEX_COUNT));
static_assert(static_cast<int>(StepStatus::INTERNAL_ERROR) ==
              static_cast<int>(deformable_ccd::ContactArray::INTERNAL_ERROR));
static_assert(static_cast<int>(StartState::NOT_CHECKED) == static_cast<int>(deformable_ccd::ContactArray::NOT_CHECKED));
static_assert(static_cast<int>(PairKind::FACE_VOXEL_CORNER) == static_cast<int>(ContactMessage::FACE_VOXEL_CORNER));
static_assert(static_cast<int>(Touching::LASTING) == static_cast<int>(deformable_ccd::State::LASTING));
static_assert(static_cast<int>(Touching::NEW) == static_cast<int>(deformable_ccd::State::NEW));
static_assert(static_cast<int>(Touching::EXPECTED) == static_cast<int>(deformable_ccd::State::EXPECTED));
static_assert(OBSTACLE_BODY == ContactMessage::OBSTACLE);

/// What most messages say first.
template <class Message>
void fillHead(const Outcome& outcome, StampNs stamp_ns, const std::string& frame, Message& out) {
  out.header = headerOf(stamp_ns, frame);
  put(outcome.status, out.status);
  put(outcome.start_state, out.start_state);
  out.answered = outcome.answered;
}

void fillFrames(const FrameCounters& frames, StatsMessage& out) {
  out.frames_received = frames.received;
  out.frames_processed = frames.processed();
  out.frames_started = frames.started();
  out.frames_skipped = frames.skipped();
  out.skipped_duplicate = frames.of(StepStatus::DUPLICATE);
  out.skipped_vertex_count = frames.of(StepStatus::VERTEX_COUNT);
  out.skipped_bad_message = frames.of(StepStatus::BAD_MESSAGE);
  out.skipped_no_transform = frames.of(StepStatus::NO_TRANSFORM);
  out.skipped_no_body = frames.of(StepStatus::NO_BODY);
  out.skipped_queue_full = frames.of(StepStatus::QUEUE_FULL);
  out.skipped_disabled = frames.of(StepStatus::DISABLED);
  out.skipped_reset = frames.of(StepStatus::RESET);
  out.skipped_error = frames.of(StepStatus::INTERNAL_ERROR);
  out.frames_waiting = frames.waiting();
  out.receipt_stamps = frames.receipt_stamps;
  out.seams_topology = frames.of(StepStatus::TOPOLOGY_CHANGED);
  out.seams_gap = frames.of(StepStatus::GAP);
  out.seams_time_jump = frames.of(StepStatus::TIME_JUMP);
  out.seams_teleport = frames.of(StepStatus::TELEPORT);
}

void fillCounts(const Outcome& outcome, StatsMessage& out) {
  out.contacts = static_cast<std::uint32_t>(outcome.total_contacts);
  out.contacts_certain = static_cast<std::uint32_t>(outcome.counts.certain);
  out.contacts_undecided = static_cast<std::uint32_t>(outcome.counts.undecided);
  out.contacts_initial = static_cast<std::uint32_t>(outcome.counts.initial);
  out.contacts_leaving = static_cast<std::uint32_t>(outcome.counts.leaving);
  out.contacts_mesh = static_cast<std::uint32_t>(outcome.counts.mesh);
  out.contacts_obstacle = static_cast<std::uint32_t>(outcome.counts.obstacle);
  out.contacts_expected = static_cast<std::uint32_t>(outcome.counts.expected);
  out.intersections = static_cast<std::uint32_t>(outcome.intersections.size());
  out.earliest_toc = plottable(outcome.earliest_toc);
}

void fillStages(const StepStats& stats, StatsMessage& out) {
  out.total_ms = stats.total_ms;
#define DCCD_FILL_COUNTER(name, same_in_every_part) out.name = static_cast<decltype(out.name)>(stats.name);
  DCCD_STEP_COUNTERS(DCCD_FILL_COUNTER)
#undef DCCD_FILL_COUNTER
  auto row = out.stages.begin();
  const auto add = [&row](const char* name, const StageStats& one) {
    row->name = name;
    row->count_in = one.in;
    row->count_out = one.out;
    row++->ms = one.ms;
  };
  constexpr std::size_t ROWS = std::tuple_size_v<decltype(stats.stages)> + std::tuple_size_v<decltype(stats.effects)>;
  static_assert(StatsMessage::_stages_type::static_size + 1 == ROWS, "start_state is a stage and an effect");
  for (std::size_t i = 0; i < stats.stages.size(); ++i) add(toString(static_cast<Stage>(i)), stats.stages[i]);
  for (std::size_t i = 0; i < stats.effects.size(); ++i) {
    const auto effect = static_cast<Effect>(i);
    if (effect != Effect::START_STATE) add(toString(effect), stats.effects[i]);
  }
  const auto tier = [&](Tier t) { return stats.tiers.settled[static_cast<std::size_t>(t)]; };
  out.tier_coincidence = tier(Tier::COINCIDENCE);
  out.tier_double_batch = tier(Tier::DOUBLE_BATCH);
  out.tier_bernstein = tier(Tier::BERNSTEIN);
  out.tier_double_double = tier(Tier::DOUBLE_DOUBLE);
  out.tier_fixed_integer = tier(Tier::FIXED_INTEGER);
  out.tier_big_integer = tier(Tier::BIG_INTEGER);
}

void fillContact(const Outcome& outcome, const Contact& contact, const ContactGeometry& geometry, std::uint64_t patch,
                 ContactMessage& out) {
#define DCCD_PUT_CONTACT(member, published) put(contact.member, out.published);
  DCCD_CONTACT_FIELDS(DCCD_PUT_CONTACT)
#undef DCCD_PUT_CONTACT
  out.patch = patch;
  out.time_of_contact = toRosTime(outcome.stampBefore(contact.toc_lower));
  put(geometry.point, out.point);
  put(geometry.normal, out.normal);
  put(geometry.weights, out.weights);
  out.approach_speed = geometry.approach_speed / std::max(outcome.duration_s(), 1e-9);
}

/// What the last message had room for is kept, but not what a burst made of it.
template <class T>
void resizeKept(std::vector<T>& list, std::size_t count) {
  list.resize(count);
  if (list.capacity() > KEPT_FOR_USE * std::max(count, ALWAYS_KEPT)) list.shrink_to_fit();
}

}  // namespace

double plottable(double value) { return std::isfinite(value) ? value : std::numeric_limits<double>::quiet_NaN(); }

std_msgs::Header headerOf(StampNs stamp_ns, const std::string& frame) {
  std_msgs::Header out;
  out.stamp = toRosTime(stamp_ns);
  out.frame_id = frame;
  return out;
}

ContactMessage toContact(const Outcome& outcome, const Contact& contact, std::uint64_t patch) {
  ContactMessage out;
  fillContact(outcome, contact, contactGeometry(outcome, contact), patch, out);
  return out;
}

ros::Time toRosTime(StampNs stamp_ns) {
  // Beyond this ros::Time throws; a message may bring such a stamp, or one so late that a prediction leads there.
  constexpr StampNs LAST_NS = 4294967295999999999;
  ros::Time time;
  time.fromNSec(static_cast<std::uint64_t>(std::clamp<StampNs>(stamp_ns, 0, LAST_NS)));
  return time;
}

deformable_ccd::ContactArray toContactArray(const Outcome& outcome, const std::vector<Body>& bodies,
                                            const std::string& frame) {
  deformable_ccd::ContactArray out;
  fillContactArray(outcome, bodies, frame, out);
  return out;
}

const deformable_ccd::ContactArray& fillContactArray(const Outcome& outcome, const std::vector<Body>& bodies,
                                                     const std::string& frame, deformable_ccd::ContactArray& out) {
  fillHead(outcome, outcome.stamp_ns, frame, out);
  out.start = toRosTime(outcome.start_ns);
  out.reason = outcome.reason;
  out.complete = outcome.complete;
  out.unchecked_toc_lower = outcome.unchecked_toc_lower;
  out.total_contacts = static_cast<std::uint32_t>(outcome.total_contacts);
  out.expected_contacts = static_cast<std::uint32_t>(outcome.counts.expected);
  out.bodies.clear();
  for (const Body& body : bodies) out.bodies.push_back(body.name);
  resizeKept(out.contacts, outcome.contacts.size());
  for (std::size_t i = 0; i < out.contacts.size(); ++i) {
    const Contact& contact = outcome.contacts[i];
    const bool in_patch = i < outcome.patch_of.size() && outcome.patch_of[i] != NO_PATCH;
    const std::uint64_t patch = in_patch ? outcome.patches[outcome.patch_of[i]].id : 0;
    fillContact(outcome, contact, contactGeometry(outcome, contact), patch, out.contacts[i]);
  }
  resizeKept(out.intersections, outcome.intersections.size());
  for (std::size_t i = 0; i < outcome.intersections.size(); ++i) {
    const StartIntersection& crossing = outcome.intersections[i];
    deformable_ccd::Intersection& message = out.intersections[i];
    put(crossing.body, message.body);
    put(crossing.vertex, message.vertex);
    message.expected = crossing.expected;
  }
  return out;
}

namespace {

deformable_ccd::FirstContact firstContact(const Outcome& outcome, StampNs stamp_ns, double horizon_s,
                                          const std::vector<Body>& bodies, const std::string& frame) {
  deformable_ccd::FirstContact out;
  fillHead(outcome, stamp_ns, frame, out);
  const double toc = earliestNewToc(outcome);
  out.contact = std::isfinite(toc);
  out.pairs = toPairContacts(outcome, bodies);
  out.lasting_patches = static_cast<std::uint32_t>(lastingPatches(outcome));
  out.expected_contacts = static_cast<std::uint32_t>(outcome.counts.expected);
  out.horizon = horizon_s;
  out.toc = plottable(toc);
  out.seconds = plottable(toc * horizon_s);
  // Rounded to the nearest it could be late.
  if (out.contact && std::fma(toc, horizon_s, -out.seconds) < 0) out.seconds = std::nextafter(out.seconds, 0);
  const Contact* first = nullptr;
  const std::vector<NewContact> found = newContacts(outcome);
  for (const NewContact& one : found) {
    if (one.contact.toc_lower != toc) continue;
    const bool certain = one.contact.certainty == Certainty::CERTAIN;
    if (!first || (certain && !out.certain)) first = &one.contact;
    out.certain |= certain;
  }
  if (out.contact) out.time_of_contact = toRosTime(outcome.stampBefore(toc));
  out.summary = firstContactInWords(outcome, toc, first, bodies);
  return out;
}

}  // namespace

deformable_ccd::FirstContact toFirstContact(const Outcome& outcome, const std::vector<Body>& bodies,
                                            const std::string& frame) {
  return firstContact(outcome, outcome.stamp_ns, outcome.duration_s(), bodies, frame);
}

deformable_ccd::FirstContact toTimeToContact(const Outcome& prediction, double horizon_s,
                                             const std::vector<Body>& bodies, const std::string& frame) {
  return firstContact(prediction, prediction.start_ns, horizon_s, bodies, frame);
}

deformable_ccd::State toState(const Outcome& outcome, const std::string& frame) {
  deformable_ccd::State out;
  out.header = headerOf(outcome.stamp_ns, frame);
  const NearestPartners nearest = nearestPartners(outcome);
  out.clearance_lower = nearest.lower_m;
  out.clearance_upper = nearest.upper_m;
  out.clearance_between = nearest.names;
  if (!outcome.answered) return out;
  const std::vector<Body>& bodies = outcome.step->bodies;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    out.checked_self |= meetsItself(bodies[b]);
    out.checked_map |= outcome.step->map.surface && meetsMap(bodies[b]);
    for (std::size_t other = 0; other < b; ++other) out.checked_bodies |= meet(bodies[other], other, bodies[b], b);
  }
  if (out.checked_map) {
    out.map_stamp = toRosTime(outcome.step->map.stamp_ns);
    out.map_age = mapAge(outcome);
  }
  out.start = toRosTime(outcome.start_ns);
  out.holds_until = toRosTime(outcome.stamp_ns);
  return out;
}

double mapAge(const Outcome& outcome) {
  const StampNs stamp_ns = outcome.step->map.stamp_ns;
  return stamp_ns == 0 ? 0 : secondsBetween(stamp_ns, outcome.stamp_ns);
}

void fillState(const Statement& statement, deformable_ccd::State& message) {
  const Assurance& assurance = statement.assurance;
  message.proved = assurance.proved;
  message.touching = static_cast<std::uint8_t>(assurance.touching);
  message.clear = assurance.clear();
  message.reason = describe(assurance, statement.touches);
  if (!assurance.proved && !statement.hint.empty()) message.reason += "; " + statement.hint;
  // Where it was left out by choice, or is missing, that is said already.
  const bool is_news = assurance.proved && !message.checked_map && !message.holds_until.isZero();
  const auto tells = [](const std::string& sentence) { return sentence.find("octomap") != std::string::npos; };
  if (is_news && std::none_of(assurance.excluded.begin(), assurance.excluded.end(), tells)) {
    message.reason += "; nothing was checked against a map";
  }
  for (const std::string& doubt : statement.doubts) {
    if (message.proved || !statement.is_doubts_fault) message.reason += "; in doubt: " + doubt;
  }
  if (!statement.broken.empty()) message.reason += "; the promise of ~safe_until was void: " + statement.broken;
  message.missing = assurance.missing;
  message.excluded = assurance.excluded;
  message.expected = assurance.expected;
}

StatsMessage toStepStats(const Outcome& outcome, const StatsContext& context, const std::string& frame) {
  StatsMessage out;
  fillHead(outcome, outcome.stamp_ns, frame, out);
  out.complete = outcome.complete;
  out.step = outcome.duration_s();
  out.latency = context.latency_s;
  out.substeps = static_cast<std::uint32_t>(outcome.substeps);
  fillFrames(context.frames, out);
  out.weld_changes = context.weld_changes;
  fillCounts(outcome, out);
  fillStages(outcome.stats, out);
  out.promises = context.promises.made;
  out.promises_kept = context.promises.kept;
  out.promises_broken = context.promises.broken;
  out.map_present = outcome.obstacle != nullptr;
  if (outcome.obstacle) {
    out.map_leaves = outcome.obstacle->leafCount();
    out.map_age = mapAge(outcome);
  }
  out.excluded_voxels = outcome.excluded_voxels;
  out.maps_received = context.maps_received;
  out.maps_refused = context.maps_refused;
  out.maps_dropped = context.maps_dropped;
  out.clouds_only_filled = context.clouds_only_filled;
  out.points_no_measurement = context.points_no_measurement;
  out.parameter_hash = context.parameter_hash;
  return out;
}

}  // namespace dccd
