// The answer to a step, and what it cost.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "dccd/clearance.h"
#include "dccd/contact.h"
#include "dccd/elementary.h"
#include "dccd/export.h"
#include "dccd/patch.h"
#include "dccd/step.h"

namespace dccd {

/// What became of a frame. Values are those of the ContactArray message. "Answered" ones come with a result,
/// "seams" begin a new pair of frames, all others drop the frame.
enum class StepStatus : std::uint8_t {
  OK = 0,
  FIRST_FRAME = 1,
  TOPOLOGY_CHANGED = 2,
  GAP = 3,
  TIME_JUMP = 4,
  NO_TRANSFORM = 5,
  NO_MAP = 6,
  NO_BODY = 7,
  PARTIAL = 8,
  DEADLINE = 9,
  TRUNCATED = 10,
  DUPLICATE = 11,
  TELEPORT = 12,
  VERTEX_COUNT = 13,
  BAD_MESSAGE = 14,
  QUEUE_FULL = 15,
  DISABLED = 16,
  RESET = 17,
  INTERNAL_ERROR = 18,
  COUNT
};
DCCD_EXPORT const char* toString(StepStatus status);
DCCD_EXPORT bool isAnswered(StepStatus status);
DCCD_EXPORT bool isSeam(StepStatus status);

/// The stages of the flow, in order. Names by toString().
enum class Stage : std::uint8_t { RECORD, BOUNDS, BROAD_PHASE, PLANAR, ELEMENTARY, OBSTACLE, START_STATE, SORT, COUNT };
/// What a scene can call for, and a user can set (doc/interface.md). Each pair and each moment counts for one effect
/// alone. The second name of a row is that of the setting and of the published fields. Those are pairs in and out, but
/// - rigid_bodies: bodies that turn or have waypoints, and how often one was placed for a part of the step;
/// - unknown_space: zeros, for the map's thread makes an obstacle of it;
/// - minimum_separation: pairs that carry a distance into the elementary test, and no uncertainty;
/// - tracker_noise: pairs whose vertices bring an uncertainty radius;
/// - look_ahead: of the last prediction, pairs past the filters, and contacts;
/// - patches: contacts and edges through faces at the start, and patches;
/// - own_voxels: voxels of the map near to bodies that were asked for, and those that are own or in doubt;
/// - clearance: pairs of partners that were asked for, and those whose distance was measured.
#define DCCD_EFFECTS(ROW)                     \
  ROW(SELF_COLLISION, self_collision)         \
  ROW(BODY_BODY, body_body)                   \
  ROW(OCTOMAP, octomap)                       \
  ROW(START_STATE, start_state)               \
  ROW(RIGID_BODIES, rigid_bodies)             \
  ROW(UNKNOWN_SPACE, unknown_space)           \
  ROW(MINIMUM_SEPARATION, minimum_separation) \
  ROW(TRACKER_NOISE, tracker_noise)           \
  ROW(LOOK_AHEAD, look_ahead)                 \
  ROW(PATCHES, patches)                       \
  ROW(OWN_VOXELS, own_voxels)                 \
  ROW(CLEARANCE, clearance)
#define DCCD_EFFECT_ENUMERATOR(EFFECT, name) EFFECT,
enum class Effect : std::uint8_t { DCCD_EFFECTS(DCCD_EFFECT_ENUMERATOR) COUNT };
#undef DCCD_EFFECT_ENUMERATOR
DCCD_EXPORT const char* toString(Stage stage);
DCCD_EXPORT const char* toString(Effect effect);

/// Pairs into and out of a stage or an effect, and its time summed over the workers.
struct StageStats {
  std::uint64_t in = 0;
  std::uint64_t out = 0;
  double ms = 0;
  StageStats& operator+=(const StageStats& other) {
    in += other.in;
    out += other.out;
    ms += other.ms;
    return *this;
  }
};

struct StepStats {
  std::array<StageStats, static_cast<std::size_t>(Stage::COUNT)> stages{};
  std::array<StageStats, static_cast<std::size_t>(Effect::COUNT)> effects{};
  TierCounters tiers;
  double total_ms = 0;  ///< from the start of a step to its outcome; what is made once for many steps is not counted
  std::uint64_t vf_candidates = 0, ee_candidates = 0;  ///< out of the linear filter
  std::uint64_t undecided = 0, initial = 0, leaving = 0;
  std::uint64_t unchecked_vertices = 0, unchecked_faces = 0;
  std::uint64_t unfolded_bodies = 0;  ///< whose self-collision was left out: no fold, contour apart from itself
  std::uint64_t bodies_refitted = 0, bodies_kept = 0;  ///< bounds computed; still those of the step before
  std::uint64_t body_pairs = 0;                        ///< pairs of different bodies whose swept bounds overlap
  std::uint64_t bodies_far = 0;        ///< near nothing that they are tested against; no bounds are computed
  std::uint64_t map_answers_kept = 0;  ///< bodies at rest whose contacts with the map are those of the step before
  /// Pairs closer in the reference frame than what they would carry that came to the elementary test without it.
  std::uint64_t left_out_met = 0;
  const StageStats& operator[](Stage s) const { return stages[static_cast<std::size_t>(s)]; }
  StageStats& operator[](Stage s) { return stages[static_cast<std::size_t>(s)]; }
  const StageStats& operator[](Effect e) const { return effects[static_cast<std::size_t>(e)]; }
  StageStats& operator[](Effect e) { return effects[static_cast<std::size_t>(e)]; }
  /// Of the parts of a step, or of the workers of one part.
  DCCD_EXPORT StepStats& operator+=(const StepStats& other);
};

/// The counters of a step: sums, JSON and the fields of ~stats follow from these rows. The name is that of the member
/// and the published one. true: a step that is cut in parts has the same in every part, so that it is not added up.
#define DCCD_STEP_COUNTERS(COUNTER) \
  COUNTER(vf_candidates, false)     \
  COUNTER(ee_candidates, false)     \
  COUNTER(undecided, false)         \
  COUNTER(initial, false)           \
  COUNTER(leaving, false)           \
  COUNTER(unchecked_vertices, true) \
  COUNTER(unchecked_faces, true)    \
  COUNTER(unfolded_bodies, false)   \
  COUNTER(bodies_refitted, false)   \
  COUNTER(bodies_kept, false)       \
  COUNTER(body_pairs, false)        \
  COUNTER(bodies_far, false)        \
  COUNTER(map_answers_kept, false)  \
  COUNTER(left_out_met, false)

struct StepCounter {
  const char* name;
  std::uint64_t StepStats::*value;
  bool same_in_every_part;
};
#define DCCD_STEP_COUNTER_ROW(name, same_in_every_part) {#name, &StepStats::name, same_in_every_part},
constexpr StepCounter STEP_COUNTERS[] = {DCCD_STEP_COUNTERS(DCCD_STEP_COUNTER_ROW)};
#undef DCCD_STEP_COUNTER_ROW
static_assert(sizeof(StepStats) == sizeof(StepStats::stages) + sizeof(StepStats::effects) + sizeof(StepStats::tiers) +
                                       sizeof(StepStats::total_ms) + sizeof(std::uint64_t) * std::size(STEP_COUNTERS),
              "every counter has a row");

/// Do surfaces already cross at t=0? (doc/algorithm.md)
enum class StartState : std::uint8_t { CLEAR = 0, INTERSECTING = 1, NOT_CHECKED = 2 };
DCCD_EXPORT const char* toString(StartState state);

/// Whether anything touches in a step: the first that holds of NEW, LASTING, EXPECTED, NONE. What could not be ruled
/// out counts. In a stream what comes back within patch_gap_s is not NEW, though its step starts CLEAR.
enum class Touching : std::uint8_t {
  NONE = 0,
  LASTING = 1,   ///< something unexpected touches, or crossed when the step began, and nothing is NEW
  NEW = 2,       ///< an alarm: of a patch that is_new or, where none are tracked, an unexpected contact, not initial
  EXPECTED = 3,  ///< all that touches, or crossed when the step began, is expected
};
DCCD_EXPORT const char* toString(Touching touching);

/// An edge through a face at t=0 (vertex[0..1] of body[0] the edge, vertex[2..4] of body[1] the face), a piece of
/// body[0] inside of the closed body[1] (vertex[0], the piece's smallest, is enclosed by its surface or on it), or a
/// mesh vertex inside occupied space (body[1] = OBSTACLE_BODY, vertex[0] the vertex). Other vertices are NO_INDEX.
struct StartIntersection {
  std::array<std::uint16_t, 2> body{0, 0};
  std::array<Index, 5> vertex{NO_INDEX, NO_INDEX, NO_INDEX, NO_INDEX, NO_INDEX};
  bool expected = false;  ///< as of a contact
};

/// What nobody looked at in a part of a step.
struct Gap {
  std::array<std::uint16_t, 2> body{0, 0};  ///< which partners may touch; OBSTACLE_BODY: the map
  bool at_start = false;                    ///< or, of any of them, whether they cross when it begins
  double from = 0, to = 1;                  ///< [1] of the step
};

/// What has to be answered of a step, and of whom. detect() answers those of each step; those of a cell are answered by
/// who makes frames and maps of what comes, and asked where MonitorOptions::in_cell says so. The words complete "nobody
/// looked ...".
#define DCCD_QUESTIONS(ROW)                                                                     \
  ROW(USABLE, BODY, STEP, "whether anything of % can be checked")                               \
  ROW(NEIGHBOURS, BODY, STEP, "whether neighbours on % that may touch do")                      \
  ROW(MAP_IS_THERE, WHOLE, STEP, "whether there is a map")                                      \
  ROW(MAP_IS_NO_BODY, WHOLE, STEP, "whether voxels near bodies are obstacles")                  \
  ROW(CONTENTS, WHOLE, STEP, "whether all of the bodies can be checked")                        \
  ROW(WAYS, WHOLE, STEP, "whether all went as the step says")                                   \
  ROW(PARTS, WHOLE, STEP, "whether the step's parts are short enough")                          \
  ROW(TIME, WHOLE, STEP, "whether there was time for all")                                      \
  ROW(START, WHOLE, STEP, "whether surfaces cross when the step begins")                        \
  ROW(SENDER, BODY, CELL, "who sends %")                                                        \
  ROW(CLOCK, BODY, CELL, "by whose clock % is stamped")                                         \
  ROW(NUMBERING, BODY, CELL, "whether vertices of % still have the numbers that name them")     \
  ROW(MAP_CLOCK, WHOLE, CELL, "by whose clock the map is stamped")                              \
  ROW(MAP_PLACE, WHOLE, CELL, "where the map was at its stamp")                                 \
  ROW(NEWEST_MAP, WHOLE, CELL, "whether a newer map came")                                      \
  ROW(TRANSFORMS, WHOLE, CELL, "whether all of tf came")                                        \
  ROW(TRANSFORM_CLOCKS, WHOLE, CELL, "by whose clocks tf is stamped")                           \
  ROW(NEWEST_FRAME, WHOLE, CELL, "whether frames still come")                                   \
  ROW(CALLS, WHOLE, CELL, "whether it began after the last call that changed what it rests on") \
  ROW(FIXED_FRAME, WHOLE, CELL, "whether the fixed frame is at rest")                           \
  ROW(ROBOT, WHOLE, CELL, "whether all of the robot is watched")
#define DCCD_QUESTION_ENUMERATOR(QUESTION, OF, BY, words) QUESTION,
enum class Question : std::uint8_t { DCCD_QUESTIONS(DCCD_QUESTION_ENUMERATOR) COUNT };
#undef DCCD_QUESTION_ENUMERATOR

/// Why a step is proved: each question was asked of each body, and somebody answered it. Nothing is by default. Of
/// pairs of partners the answers are gaps (src/proof/looked.h).
class Claim {
 public:
  /// The step has so many bodies. Before, the claim does not hold.
  DCCD_EXPORT void ask(std::size_t bodies);
  /// Those of a cell, too.
  void askOfCell() { of_cell_ = true; }
  /// why_not: a sentence; empty: it is as it should be. `body` of a question that is not of a body is left out. One
  /// that is answered again needs all of its answers.
  DCCD_EXPORT void answer(Question question, const std::string& why_not, std::size_t body = 0);
  DCCD_EXPORT void answer(Question question, const std::vector<std::string>& why_not);
  /// Parts follow each other. Of more gaps than a few the first are kept.
  DCCD_EXPORT void add(std::size_t part, std::size_t parts, const std::vector<Gap>& gaps);
  /// Of a recording, which has in words what was said of its claim.
  DCCD_EXPORT static Claim thatWasSaid(const std::vector<std::string>& missing);

  /// All of it was looked at: no part is missing, and none has a gap.
  bool isCovered() const { return parts_ > 0 && covered_ == parts_ && gaps_.empty(); }
  DCCD_EXPORT bool holds() const;
  /// It holds, but that something was not looked at for want of time.
  DCCD_EXPORT bool holdsButForTime() const;
  const std::vector<Gap>& gaps() const { return gaps_; }
  /// Why it does not hold, a sentence each; empty exactly when it does. `bodies`: for their names.
  DCCD_EXPORT std::vector<std::string> missing(const std::vector<Body>& bodies) const;

 private:
  struct Denied {
    Question question;
    std::string why;
  };
  std::uint32_t asked(bool of_body) const;
  bool isAnswered() const;

  std::vector<std::uint32_t> answered_;  // by body, and last of the step as a whole: a bit a question
  std::vector<Denied> denied_;           // in the order in which they were answered
  bool of_cell_ = false;
  std::size_t covered_ = 0, parts_ = 0;
  std::vector<Gap> gaps_;
};

/// Of how many contacts what holds.
struct ContactCounts {
  std::size_t certain = 0, undecided = 0;
  std::size_t initial = 0, leaving = 0;
  std::size_t mesh = 0, obstacle = 0;              ///< with a body, with the map
  std::size_t expected = 0, expected_initial = 0;  ///< the latter: both at once
  std::size_t unexpectedNew() const { return certain + undecided - initial - (expected - expected_initial); }
  std::size_t unexpectedInitial() const { return initial - expected_initial; }
};

/// What is found in a step, or in one of the parts that it is cut into.
struct Findings {
  std::vector<Contact> contacts;  ///< in canonical order
  StartState start_state = StartState::NOT_CHECKED;
  std::vector<StartIntersection> intersections;  ///< of edges through faces one at the most with earliest_only
  bool start_state_complete = false;             ///< all that can meet at t0 was looked at, or nobody asked for it
  /// False: the step budget ran out, or max_found was reached, before the last pair or, of a whole step, before the
  /// start state was known.
  bool complete = true;
  bool cut = false;  ///< there was more to find than Options::max_found
  /// Pairs were left out, none of which can touch before this; otherwise infinity.
  double unchecked_toc_lower = std::numeric_limits<double>::infinity();
  StepStats stats;
};

/// What became of a step, or of a frame that made none. Shares what it names: it may be kept.
/// Its contacts are filtered and cut as the options say, their toc is that of the whole step.
struct Outcome : Findings {
  StepStatus status = StepStatus::FIRST_FRAME;
  std::string reason;  ///< one sentence; empty when OK
  StampNs start_ns = 0, stamp_ns = 0;
  std::uint64_t sequence = 0;   ///< of the clock body's frames that were pushed or skipped, from 1
  std::int64_t arrival_ns = 0;  ///< of the message that it is about: MeshFrame::arrival_ns
  bool answered = false;        ///< the fields below hold a result

  std::size_t total_contacts = 0;        ///< before the cut to max_contacts; with `cut` there are at least so many
  ContactCounts counts;                  ///< of all of these
  std::vector<Patch> patches;            ///< of all that was found, by its first contact; with Options::patches
  std::vector<std::uint32_t> patch_of;   ///< per listed contact its patch; empty without Options::patches
  bool tracked = false;                  ///< patches have identities: it is of a stream, or a prediction of one
  std::vector<PatchEvent> patch_events;  ///< in a stream, in order; also of an outcome without a result, at a seam
  std::vector<Clearance> clearances;     ///< with Options::clearance, as of distance(); of stats' clearance.in pairs
  std::size_t suppressed = 0;            ///< initial contacts left out by choice
  std::uint64_t excluded_voxels = 0;     ///< finest voxels of the map taken out by exclude_boxes
  double earliest_toc = std::numeric_limits<double>::infinity();             ///< over contacts and what was left out
  double earliest_unexpected_toc = std::numeric_limits<double>::infinity();  ///< the same without what is expected
  std::size_t substeps = 0;                                                  ///< parts that the step was cut into
  Touching touching = Touching::NONE;  ///< as if no patches were tracked; Assurance::touching holds
  Claim claim;                         ///< what assuranceOf() judges by (dccd/assurance.h)
  std::vector<std::string> excluded;   ///< what was left out by choice, a sentence each
  std::vector<std::string> expected;   ///< which contacts are expected, whether or not there are any, a sentence each

  std::shared_ptr<const Step> step;              ///< what it answers; null where nothing was answered
  std::shared_ptr<const VoxelSurface> obstacle;  ///< of the step's map, what exclude_boxes left; null: none
  /// What distances from the map are taken to: `obstacle` with OwnVoxels::seen. Null: no distances, or no map.
  std::shared_ptr<const VoxelSurface> measured;

  /// Why it is not proved, a sentence each.
  std::vector<std::string> missing() const { return step ? claim.missing(step->bodies) : claim.missing({}); }
  /// No pair was left out of the contacts, whatever is known of the start state.
  bool allPairs() const { return !(unchecked_toc_lower <= 1); }
  double duration_s() const { return secondsBetween(start_ns, stamp_ns); }
  /// A stamp that is not later than this time of the step [1].
  StampNs stampBefore(double toc) const {
    const auto step_ns = static_cast<double>(stamp_ns - start_ns);
    const double whole_ns = std::floor(toc * step_ns);
    // The product may have been rounded up to a whole nanosecond; what fma() leaves has its true sign.
    return start_ns + static_cast<StampNs>(std::fma(toc, step_ns, -whole_ns) < 0 ? whole_ns - 1 : whole_ns);
  }
  /// A stamp that is not earlier, and not past the step's end.
  StampNs stampAfter(double toc) const {
    const double after_ns = std::ceil(toc * static_cast<double>(stamp_ns - start_ns));
    return std::min(stamp_ns, start_ns + 1 + static_cast<StampNs>(after_ns));
  }
};

/// Point, normal, weights and approach speed [m per step] of one of the outcome's contacts, any kind, in the fixed
/// frame.
DCCD_EXPORT ContactGeometry contactGeometry(const Outcome& outcome, const Contact& contact);

/// Where one of the contact's vertices is at its toc_lower [m], fixed frame; i counts Contact::vertex. Of a rigid body
/// that turns, on the path that was tested: the chord of that part of the step.
DCCD_EXPORT Vec3 vertexAtContact(const Outcome& outcome, const Contact& contact, int i);

}  // namespace dccd
