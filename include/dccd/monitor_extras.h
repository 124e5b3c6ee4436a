// What a monitor of a stream needs besides its answers: until when nothing can touch, and how fast one may go; what of
// an answer is news; and the SIMD target of the process.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "dccd/export.h"
#include "dccd/outcome.h"

namespace dccd {

/// What is assumed of a body's speed after a step.
struct SpeedBound {
  static constexpr double NONE = std::numeric_limits<double>::infinity();
  /// No vertex is ever faster, at full speed either [m/s], 0 or more; NONE: nobody says.
  double max_m_s = NONE;
  bool slows_down = true;  ///< SpeedScale slows it; false: it goes on as fast, whatever the scale
  /// A rigid body of the step that carries this one, if that is another one than itself: no vertex leaves the place at
  /// which it would be carried faster than relative_m_s. Against what the same body carries this counts where it is
  /// less: distances are the same in its frame.
  std::size_t carrier = NO_CARRIER;
  double relative_m_s = NONE;
  static constexpr std::size_t NO_CARRIER = std::numeric_limits<std::size_t>::max();
};

/// Nothing is promised beyond this much after a step's end [s].
constexpr double MOST_PROMISED_S = 10;

/// No contact of two partners that is not expected comes before until_ns.
///
/// Theorem. Let d be the distance of two partners at the step's end, less what the step holds them apart (minimum
/// separation), and v the sum of their bounds. Then they do not touch before the end + d / v. Of two bodies of which
/// one is inside of the other, closed one, d is 0, however far apart their surfaces are: they touch. So it is where
/// nobody knows: they met in the step, or the budget cut the search for what is inside, and the boxes around them meet.
/// Proof. A point of a face or an edge is a mean of its vertices, with weights that stay; no vertex goes further than
/// its bound times the time, so neither does the point. Two points that are d apart need d / v to meet.
/// It rests on this:
/// - a vertex is where the step ends, or within its uncertainty radius of there (d is less by the radii);
/// - no vertex is faster afterwards than its body's bound; a body against itself counts with twice its bound; one that
///   is carried leaves its carrier no faster than it may (v is then the sum of these, in the carrier's frame);
/// - the surface stays straight between its vertices, and has the same edges and faces;
/// - the map gets no voxel, and stays where it is. Bodies and features that the step leaves out are not spoken of, nor
///   are a body's own features that are neighbours (ClearanceOptions::self_m; where that is 0 all of them) or features
///   that share a vertex.
/// d / v is rounded down.
struct SafeUntil {
  static constexpr std::size_t NO_PAIR = std::numeric_limits<std::size_t>::max();
  StampNs stamp_ns = 0;  ///< the step's end
  StampNs until_ns = 0;  ///< not before stamp_ns; equal to it: nothing is promised
  /// The same of pairs of two bodies, or of one and the map, alone: of a body and itself no more than a quarter of
  /// ClearanceOptions::self_m is known.
  StampNs others_until_ns = 0;
  /// The pair in Outcome::clearances that ends first; of several the first. NO_PAIR: none, or one without a row.
  std::size_t limiting = NO_PAIR;
  /// Of that pair, at stamp_ns: their least distance as above [m], and the sum of their bounds [m/s]. NaN without one.
  double distance_m = std::numeric_limits<double>::quiet_NaN();
  double closing_m_s = std::numeric_limits<double>::quiet_NaN();
  std::string reason;  ///< why until_ns is the step's end; empty where it is not
  bool isPromise() const { return others_until_ns > stamp_ns; }
  double seconds() const { return secondsBetween(stamp_ns, until_ns); }  ///< 0 to MOST_PROMISED_S
  double othersSeconds() const { return secondsBetween(stamp_ns, others_until_ns); }
};

/// From the outcome's clearances at its end. `bounds`: by body; of those that are missing nobody says anything.
/// Nothing is promised of an outcome without an answer, of a step with anything unproved but what a budget cut off,
/// without distances, and where a pair touches, is undecided, or has a body without a bound. Throws
/// std::invalid_argument naming the body whose bound is NaN or below 0.
DCCD_EXPORT SafeUntil safeUntil(const Outcome& outcome, const std::vector<SpeedBound>& bounds);

/// What became of promises. Those that are neither kept nor void nobody has looked at: a reset came before the next
/// answer, or none has come.
struct PromiseCounts {
  std::uint64_t made = 0;
  std::uint64_t kept = 0;  ///< the next answer shows nothing else
  std::uint64_t broken = 0;
  std::uint64_t unseen() const { return made - kept - broken; }
};

/// Holds each promise against the next answer: was a body faster than was assumed, or has the map new voxels? What it
/// does not find may still have happened between the two. Not thread-safe.
class DCCD_EXPORT PromiseWatch {
 public:
  /// From the next promise on.
  void setBounds(std::vector<SpeedBound> bounds) { bounds_ = std::move(bounds); }
  /// The next promise, after a look at the last one. Of an outcome without an answer none, and the last one stands.
  const SafeUntil& follow(const Outcome& outcome);
  /// What follow() made of this outcome, the newest answer, is this promise, no earlier than by bounds alone. If it
  /// rests on something more `why_void` says of the next answer, if that comes before the promise ends, why that was
  /// not so; empty: it was. A second one takes the first one's place; broken() tells where it is earlier.
  void extend(const Outcome& outcome, const SafeUntil& later, std::function<std::string(const Outcome&)> why_void);
  /// What the promise rests on has changed, as which contacts are expected, or which bodies there are: it is void from
  /// now on, and the next answer says so. `why`: a sentence. Without a promise that stands nothing happens.
  void revoke(const std::string& why);
  /// Nothing is looked back on, as after a reset, and nothing is promised until the next answer. `why`: as revoke()'s.
  void forget(const std::string& why = {});

  const SafeUntil& promise() const { return promise_; }
  /// Why the promise before this one, or the one that was revoked, was void; empty: it was not, as far as both answers
  /// tell, or there was none.
  const std::string& broken() const { return broken_; }
  /// revoke() has taken the promise back, and no answer has come since.
  bool isRevoked() const { return !revoked_.empty(); }
  const PromiseCounts& counts() const { return counts_; }

 private:
  std::vector<SpeedBound> bounds_;
  SafeUntil promise_;
  std::string broken_, revoked_;  // the latter until the next answer
  PromiseCounts counts_;
  // Of the last promise: what it was made of.
  std::shared_ptr<const Step> step_;
  std::shared_ptr<const VoxelSurface> obstacle_;
  std::vector<SpeedBound> assumed_;
  std::function<std::string(const Outcome&)> why_void_;
  void keep(const Outcome& outcome);
};

/// The three numbers of the law, in the terms of ISO/TS 15066, 5.5.4.
struct SpeedLaw {
  /// T_r: from a frame's stamp until what slows down begins to follow the next one's scale [s].
  double reaction_time_s = 0;
  double stopping_time_s = 0;  ///< T_s: from full speed to standing still, evenly slower; 0: at once [s]
  double uncertainty_m = 0;    ///< C + Z_d + Z_r: what is to be left at the end [m]
};

/// The protective separation distance at a scale s [m]: S_p = S_h + S_r + S_s + C + Z_d + Z_r, where
/// - S_h = v_h (T_r + s T_s) is the way of what does not slow down, of at most v_h [m/s];
/// - S_r = s v_r T_r is the way of what does, of at most v_r at full speed, until it begins to;
/// - S_s = s v_r (s T_s) / 2 is its way until it stands, which from s times the speed takes s times as long.
DCCD_EXPORT double separationDistance(double scale, double v_r_m_s, double v_h_m_s, const SpeedLaw& law);
/// The largest scale, 0 to 1, whose S_p is at most this distance; 0 where there is none, and of what is not finite.
/// Never less for a larger distance, never more for larger speeds.
DCCD_EXPORT double speedScale(double distance_m, double v_r_m_s, double v_h_m_s, const SpeedLaw& law);

struct SpeedScale {
  double scale = 0;                                              ///< 0 to 1 of full speed
  std::size_t limiting = SafeUntil::NO_PAIR;                     ///< as there, the pair that allows least
  double distance_m = std::numeric_limits<double>::quiet_NaN();  ///< of that pair, as in SafeUntil [m]
  double needed_m = std::numeric_limits<double>::quiet_NaN();    ///< its S_p at full speed [m]
  std::string reason;                                            ///< why it is less than 1; empty: it is 1
};

/// The least over all pairs of two bodies, or of one and the map, that are not expected to touch, and of which
/// something slows down, be it at rest now; 0 where safeUntil() promises nothing for lack of an answer, where the full
/// speed of one of them is not known (SpeedBound::max_m_s), where one may be inside of the other, and where something
/// unexpected touches anew, be it a body and itself. What else stands in the way of a proof (Assurance) is the caller's
/// matter. Throws as safeUntil() does, and names a number of the law that is not finite or below 0.
DCCD_EXPORT SpeedScale speedScale(const Outcome& outcome, const std::vector<SpeedBound>& bounds, const SpeedLaw& law);

// --- news: contacts that are not expected and belong to no patch that lasts. Alarms are about these. ---

/// The earliest new contact of a pair of partners.
struct NewContact {
  std::array<std::uint16_t, 2> body{0, 0};  ///< as in Patch
  std::uint64_t patch = 0;                  ///< identity of its patch; 0: of a prediction, or without patches
  Contact contact;
};

/// The first touch of a new patch that is not expected is not before this, [1] of the step: 0 where surfaces cross.
inline double newsTocLower(const Patch& patch) { return patch.crossings > 0 ? 0 : patch.earliest.toc_lower; }

/// One for each pair of partners, the earliest first; of one time in canonical order. Of patches that are new
/// (Patch::is_new) or, where none are tracked, of all contacts that are not expected. Of a patch that is new by edges
/// that cross faces when the step begins alone there is none.
DCCD_EXPORT std::vector<NewContact> newContacts(const Outcome& outcome);

/// Not after the first of them, nor after what was left unchecked: [1] of the step; infinity: neither is there. 0 where
/// surfaces cross that is new, or not expected where patches are not tracked.
DCCD_EXPORT double earliestNewToc(const Outcome& outcome);

// --- the SIMD target of the process: the best that the processor has, or a named one for tests and measurements ---

/// Names of the targets that this build and this processor share, best first, e.g. AVX2, SSE4, SSSE3.
DCCD_EXPORT std::vector<std::string> simdTargets();

/// The name of the target in use.
DCCD_EXPORT std::string simdTarget();

/// "auto" or one of simdTargets(). Process-wide: call it at start, before any work. Answers do not depend on it.
/// Throws std::invalid_argument naming the value and the usable ones.
DCCD_EXPORT void setSimdTarget(const std::string& name);

}  // namespace dccd
