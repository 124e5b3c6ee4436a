#include "step/conclude.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <tuple>
#include <utility>

#include "step/parts.h"

namespace dccd {
namespace {

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

/// How many there are of each kind, and when the first ones begin, all of it in one pass.
void countContacts(Outcome& outcome) {
  ContactCounts counts;
  double earliest = outcome.unchecked_toc_lower, earliest_unexpected = earliest;
  for (const Contact& contact : outcome.contacts) {
    ++(contact.certainty == Certainty::CERTAIN ? counts.certain : counts.undecided);
    ++(contact.body[1] == OBSTACLE_BODY ? counts.obstacle : counts.mesh);
    counts.initial += contact.initial;
    counts.leaving += contact.leaving;
    counts.expected += contact.expected;
    counts.expected_initial += contact.expected && contact.initial;
    earliest = std::min(earliest, contact.toc_lower);
    if (!contact.expected) earliest_unexpected = std::min(earliest_unexpected, contact.toc_lower);
  }
  outcome.total_contacts = outcome.contacts.size();
  outcome.counts = counts;
  outcome.earliest_toc = earliest;
  outcome.earliest_unexpected_toc = earliest_unexpected;
}

/// Takes those off the list of which keep(i) is false, with what is said of each.
template <class Keep>
void keepThose(const Keep& keep, Outcome& outcome) {
  std::vector<Contact>& contacts = outcome.contacts;
  std::vector<std::uint32_t>& patch_of = outcome.patch_of;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (!keep(i)) continue;
    if (!patch_of.empty()) patch_of[kept] = patch_of[i];
    contacts[kept++] = contacts[i];
  }
  contacts.resize(kept);
  if (!patch_of.empty()) patch_of.resize(kept);
}

/// Unexpected ones first: an alarm must not be crowded out by what rests where it is meant to.
void keepEarliest(std::size_t count, Outcome& outcome) {
  std::vector<Contact>& contacts = outcome.contacts;
  if (contacts.size() <= count) return;
  std::vector<std::tuple<bool, double, std::size_t>> times;  // and places: of equal times the first are kept
  times.reserve(contacts.size());
  const auto timeOf = [&](std::size_t i) { return std::make_tuple(contacts[i].expected, contacts[i].toc_lower, i); };
  for (std::size_t i = 0; i < contacts.size(); ++i) times.push_back(timeOf(i));
  const auto first_left_out = times.begin() + static_cast<std::ptrdiff_t>(count);
  std::nth_element(times.begin(), first_left_out, times.end());
  keepThose([&](std::size_t i) { return timeOf(i) < *first_left_out; }, outcome);
  contacts.shrink_to_fit();
  outcome.patch_of.shrink_to_fit();
}

std::vector<bool> maskedOf(const Body& body) {
  std::vector<bool> masked(body.topology->vertexCount());
  for (const Index v : body.vertex_mask) masked.at(v) = true;
  return masked;
}

/// Is every vertex on an edge or a face left out? Then nothing of the body was looked at.
bool isMaskedWhole(const Body& body) {
  const std::vector<Index>& used = body.topology->usedVertices();
  if (body.vertex_mask.empty() || body.vertex_mask.size() < used.size()) return false;
  const std::vector<bool> masked = maskedOf(body);
  return std::all_of(used.begin(), used.end(), [&](Index v) { return masked[v]; });
}

/// The first vertex whose position at an end is not finite: " (the first is 17 of 'cloth')". Empty: it is so in
/// between.
std::string firstLost(const Step& step) {
  for (const Body& body : step.bodies) {
    const std::vector<bool> masked = maskedOf(body);
    for (const Index v : body.topology->usedVertices()) {
      if (masked[v] || ((*body.t0)[v].allFinite() && (*body.t1)[v].allFinite())) continue;
      return " (the first is " + std::to_string(v) + " of '" + body.name +
             (body.rigid ? "', whose place is not known)" : "')");
    }
  }
  return "";
}

/// What of the bodies was not looked at, counted; in words, or empty.
std::string takeUnchecked(const Step& step, StepStats& stats) {
  std::uint64_t dropped = 0, loose = 0;
  for (const Body& body : step.bodies) {
    dropped += body.dropped_faces;
    loose += looseVertices(body);
  }
  const std::uint64_t lost = stats.unchecked_vertices;
  stats.unchecked_vertices += loose;
  stats.unchecked_faces += dropped;
  std::string text;
  const auto add = [&](std::uint64_t count, const char* one, const char* many) {
    if (count > 0) text += (text.empty() ? "" : " and ") + std::to_string(count) + (count == 1 ? one : many);
  };
  add(lost, " vertex is not finite and was not checked", " vertices are not finite and were not checked");
  if (lost > 0) text += firstLost(step);
  add(dropped, " face was sent that cannot be used and was not checked",
      " faces were sent that cannot be used and were not checked");
  add(loose, " vertex belongs to no face and no edge and was not checked",
      " vertices belong to no face and no edge and were not checked");
  return text;
}

/// What it is cut into parts for.
std::string waysInWords(const Step& step) {
  std::ostringstream text;
  for (const Body& body : step.bodies) {
    const double off_m = offWay(body, body.waypoints);
    if (off_m > 0)
      text << (text.str().empty() ? "" : ", ") << "body '" << body.name << "' was seen up to " << off_m
           << " m off the way from the step's start to its end";
  }
  if (!text.str().empty()) return text.str();
  return step.map.way.empty() ? "a rigid body turns far" : "the octomap's frame moves far";
}

/// Why there was not time, or room, for all of it; empty: there was.
std::string cutInWords(const Options& options, const Outcome& outcome) {
  const auto notBefore = [&] {  // rounded down, as the bound is
    const double toc = outcome.unchecked_toc_lower, millionths = std::floor(toc * 1e6);
    // The product may have been rounded up to a whole number; what fma() leaves has its true sign.
    const double below = std::fma(toc, 1e6, -millionths) < 0 ? millionths - 1 : millionths;
    return "nothing that was left out touches before toc " + std::to_string(below / 1e6);
  };
  if (outcome.cut) {
    return "at least " + std::to_string(outcome.total_contacts) +
           " contacts; the work was cut at the limit of what a step may find; " +
           (outcome.allPairs() ? "not all of the start state was looked at" : notBefore());
  }
  if (outcome.complete) return "";
  return (options.step_budget_ms > 0 ? "the step budget ran out"
                                     : "the time that a step may take without a budget ran out") +
         (outcome.allPairs() ? " before all of the start state was looked at; no pair was left out of the contacts"
                             : "; " + notBefore());
}

std::string tooFewPartsInWords(const Step& step, std::size_t needed_parts, std::size_t parts) {
  if (parts >= needed_parts) return "";
  return waysInWords(step) + ", so that " +
         (needed_parts == NO_NUMBER_OF_PARTS ? std::string("no number of equal parts follows it")
                                             : std::to_string(needed_parts) + " parts are needed") +
         "; at most " + std::to_string(parts) + " are allowed (raise rigid_tolerance_m)";
}

/// Answers what is asked of each step. Reasons for less than a whole answer come in ascending order of weight, and the
/// last one gives the status.
void judge(const Options& options, const Step& step, std::size_t needed_parts, Outcome& outcome) {
  Claim& claim = outcome.claim;
  outcome.status = StepStatus::OK;
  const auto say = [&](StepStatus status, const std::string& reason) {
    if (reason.empty()) return;
    outcome.status = status;
    outcome.reason = reason;
  };
  const auto answer = [&](Question question, StepStatus status, const std::string& why_not) {
    say(status, why_not);
    claim.answer(question, why_not);
  };
  answer(Question::CONTENTS, StepStatus::PARTIAL, takeUnchecked(step, outcome.stats));
  answer(Question::WAYS, StepStatus::PARTIAL, step.off_path);
  if (!step.map.way.empty() && !options.exclude_boxes.empty()) {
    answer(Question::WAYS, StepStatus::PARTIAL,
           "the octomap's frame moves, and exclude_boxes do not; set fixed_frame to it");
  }
  // A list that is cut says nothing wrong about what touches, and all of it was looked at.
  if (outcome.contacts.size() < outcome.total_contacts) {
    say(StepStatus::TRUNCATED, "the earliest " + std::to_string(outcome.contacts.size()) + " of " +
                                   std::to_string(outcome.total_contacts) + " contacts are listed");
  }
  answer(Question::TIME, outcome.cut ? StepStatus::TRUNCATED : StepStatus::DEADLINE, cutInWords(options, outcome));
  answer(Question::PARTS, StepStatus::PARTIAL, tooFewPartsInWords(step, needed_parts, outcome.substeps));
  const bool lacks_map = options.obstacle_expected && !step.map.surface;
  const std::string why = step.map.problem.empty() ? "there is no map" : step.map.problem;
  answer(Question::MAP_IS_THERE, StepStatus::NO_MAP, lacks_map ? why + "; checked without it" : "");
  // None of these changes the status: the step was computed as it was asked for.
  claim.answer(Question::MAP_IS_NO_BODY, step.map.own.doubt);
  for (std::size_t b = 0; b < step.bodies.size(); ++b) {
    const Body& body = step.bodies[b];
    claim.answer(Question::USABLE,
                 isMaskedWhole(body)
                     ? "vertex_mask names every vertex of body '" + body.name + "', so nothing of it was checked"
                     : "",
                 b);
  }
  const bool knows_start = outcome.start_state != StartState::NOT_CHECKED || !outcome.start_state_complete;
  claim.answer(Question::START, knows_start ? "" : "whether surfaces cross at the start was not checked");
  // Where time or a limit left something out, that was said.
  if (!claim.isCovered()) outcome.complete = false;
}

/// "bodies 'cloth', 'pad'". Many links of a robot are counted: a list of 41 names hides what else is in it.
std::string inWords(const std::vector<const Body*>& bodies) {
  constexpr std::size_t MOST_LINKS = 3;
  std::set<std::string> links;
  for (const Body* body : bodies) links.insert(body->link);
  links.erase("");
  const bool are_counted = links.size() > MOST_LINKS;
  std::vector<std::string> names;
  for (const Body* body : bodies) {
    if (!are_counted || body->link.empty()) names.push_back("'" + body->name + "'");
  }
  std::string text;
  if (!names.empty()) text = names.size() + are_counted == 1 ? "body " : "bodies ";
  if (are_counted) names.push_back("the robot's " + std::to_string(links.size()) + " links");
  for (const std::string& name : names) text += (&name == &names.front() ? "" : ", ") + name;
  return text;
}

/// What was left out on request: whoever reads "proved" must see it.
std::vector<std::string> excludedByChoice(const Options& options, const Step& step, std::uint64_t excluded_voxels) {
  std::vector<std::string> excluded = options.excluded;
  const bool others = step.bodies.size() > 1;
  for (const Body& body : step.bodies) {
    if (body.vertex_mask.empty()) continue;
    excluded.push_back("body '" + body.name + "': " + std::to_string(body.vertex_mask.size()) +
                       " vertices by vertex_mask");
  }
  const auto add = [&](const std::string& what, const auto& holds) {
    std::vector<const Body*> bodies;
    for (const Body& body : step.bodies) {
      if (holds(body) && body.topology->vertexCount() > 0) bodies.push_back(&body);
    }
    if (!bodies.empty()) excluded.push_back(inWords(bodies) + ": " + what);
  };
  add("not against itself", [](const Body& body) { return !body.self_collision && !body.rigid; });
  add("not against other bodies", [&](const Body& body) { return !body.against_bodies && others; });
  add("not against the map", [](const Body& body) { return !body.against_obstacle; });
  add("others may be inside of it", [&](const Body& body) { return body.shell && others; });
  if (!options.exclude_boxes.empty()) {
    excluded.push_back(std::to_string(excluded_voxels) + " voxels of the map by exclude_boxes");
  }
  if (!step.map.own.excluded.empty()) excluded.push_back(step.map.own.excluded);
  return excluded;
}

/// With earliest_only, beside a contact: nobody looked whether more begin after it.
bool hidesLaterOnes(const Options& options, const Outcome& outcome) {
  return options.earliest_only && outcome.total_contacts + outcome.suppressed > 0;
}

/// INTERSECTING needs no case of its own: what crosses is a listed intersection or an initial contact with the map.
Touching touchingOf(const Options& options, const Outcome& outcome, std::size_t suppressed_unexpected) {
  const ContactCounts& counts = outcome.counts;
  if (counts.unexpectedNew() > 0 || hidesLaterOnes(options, outcome)) return Touching::NEW;
  const bool crosses = std::any_of(outcome.intersections.begin(), outcome.intersections.end(),
                                   [](const StartIntersection& one) { return !one.expected; });
  if (counts.unexpectedInitial() > 0 || suppressed_unexpected > 0 || crosses) return Touching::LASTING;
  const bool touches = outcome.total_contacts > 0 || outcome.suppressed > 0 || !outcome.intersections.empty();
  return touches ? Touching::EXPECTED : Touching::NONE;
}

/// Takes the initial contacts with the map off the list; returns how many of them were unexpected.
std::size_t suppressInitial(Outcome& outcome) {
  auto& contacts = outcome.contacts;
  const auto goes = [](const Contact& c) { return c.initial && c.body[1] == OBSTACLE_BODY; };
  const auto unexpected =
      std::count_if(contacts.begin(), contacts.end(), [&](const Contact& c) { return goes(c) && !c.expected; });
  const std::size_t before = contacts.size();
  keepThose([&](std::size_t i) { return !goes(contacts[i]); }, outcome);
  outcome.suppressed = before - contacts.size();
  return static_cast<std::size_t>(unexpected);
}

/// toc of part i of n as a fraction of the whole step, outwards. The quotient is rounded by half a unit in its last
/// place, which one step covers; a sum that is rounded, too, adds up to one unit more, which the second step covers.
double scale(double toc, std::size_t i, std::size_t n, double towards) {
  const double before = static_cast<double>(i), sum = before + toc;
  const double fraction = std::nextafter(sum / static_cast<double>(n), towards);
  const bool exact = sum - before == toc;  // the difference is: the sum is at most 1 above
  return std::clamp(exact ? fraction : std::nextafter(fraction, towards), 0.0, 1.0);
}

/// Orders vertices by where they are all through a step, and how well that is known: two that are equal go together.
struct Places {
  std::vector<const Positions*> at;  ///< at both ends, and where it is seen in between
  const std::vector<double>* radius_m;

  explicit Places(const Body& body) : at{body.t0.get(), body.t1.get()}, radius_m(body.radius_m.get()) {
    for (const Waypoint& w : body.waypoints) {
      if (w.positions) at.push_back(w.positions.get());
    }
  }
  bool isFinite(Index v) const {
    return std::all_of(at.begin(), at.end(), [&](const Positions* p) { return (*p)[v].allFinite(); });
  }
  bool operator()(Index a, Index b) const {
    for (const Positions* p : at) {
      const Vec3 &x = (*p)[a], &y = (*p)[b];
      if (x != y) return std::lexicographical_compare(x.data(), x.data() + 3, y.data(), y.data() + 3);
    }
    return radius_m && (*radius_m)[a] < (*radius_m)[b];
  }
};

/// Vertices that are looked at, of those that go together one.
std::set<Index, Places> placesLookedAt(const Body& body) {
  const Places places(body);
  std::set<Index, Places> found(places);
  std::vector<bool> masked(body.topology->vertexCount());
  for (const Index v : body.vertex_mask) masked.at(v) = true;
  for (const Index v : body.topology->usedVertices()) {
    if (!masked[v] && places.isFinite(v)) found.insert(v);
  }
  return found;
}

}  // namespace

std::uint64_t looseVertices(const Body& body) {
  const Topology& topology = *body.topology;
  const std::size_t used = topology.usedVertices().size();
  if (used == topology.vertexCount() || (body.rigid && used > 0)) return 0;
  std::vector<bool> accounted(topology.vertexCount());
  for (const Index v : topology.usedVertices()) accounted[v] = true;
  for (const Index v : body.vertex_mask) accounted.at(v) = true;
  if (std::all_of(accounted.begin(), accounted.end(), [](bool is) { return is; })) return 0;
  const std::set<Index, Places> looked_at = placesLookedAt(body);
  std::uint64_t loose = 0;
  for (Index v = 0; v < accounted.size(); ++v) {
    if (!accounted[v] && !(looked_at.key_comp().isFinite(v) && looked_at.count(v) > 0)) ++loose;
  }
  return loose;
}

double scaleDown(double toc, std::size_t i, std::size_t n) { return n == 1 ? toc : scale(toc, i, n, 0.0); }
double scaleUp(double toc, std::size_t i, std::size_t n) { return n == 1 ? toc : scale(toc, i, n, 2.0); }

void leaveOut(double toc, bool by_limit, Findings& found) {
  found.complete = false;
  found.cut = found.cut || by_limit;
  found.unchecked_toc_lower = std::min(found.unchecked_toc_lower, toc);
}

void addPart(std::size_t part, std::size_t parts, const std::vector<Gap>& gaps, Findings& result, Outcome& outcome) {
  outcome.claim.add(part, parts, gaps);
  if (part == 0) {
    outcome.start_state = result.start_state;
    outcome.start_state_complete = result.start_state_complete;
    outcome.complete = outcome.complete && result.start_state_complete;
    outcome.intersections = std::move(result.intersections);
  }
  if (parts == 1) {
    outcome.contacts = std::move(result.contacts);
  } else {
    for (Contact contact : result.contacts) {
      contact.toc_lower = scaleDown(contact.toc_lower, part, parts);
      contact.toc_upper = scaleUp(contact.toc_upper, part, parts);
      contact.initial = contact.initial && part == 0;
      outcome.contacts.push_back(contact);
    }
  }
  outcome.cut = outcome.cut || result.cut;
  if (!result.complete) leaveOut(scaleDown(std::min(result.unchecked_toc_lower, 1.0), part, parts), false, outcome);
  outcome.stats += result.stats;
}

void joinParts(std::vector<Contact>& contacts) {
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
}

void conclude(const Options& options, const Step& step, std::size_t needed_parts, Outcome& outcome) {
  // In this order: the counts are of all that is reported, listed or not, and judge() compares them with the list.
  const std::size_t suppressed_unexpected = options.suppress_initial ? suppressInitial(outcome) : 0;
  countContacts(outcome);
  keepEarliest(options.max_contacts, outcome);
  judge(options, step, needed_parts, outcome);
  outcome.stats[Effect::OWN_VOXELS].in = step.map.own.looked_at;
  outcome.stats[Effect::OWN_VOXELS].out = step.map.own.own + step.map.own.doubted;
  outcome.excluded = excludedByChoice(options, step, outcome.excluded_voxels);
  if (hidesLaterOnes(options, outcome)) {
    outcome.excluded.emplace_back("contacts that begin after the first one by earliest_only");
  }
  outcome.expected = describe(options.expected, step.bodies);
  outcome.touching = touchingOf(options, outcome, suppressed_unexpected);
  outcome.answered = true;
}

}  // namespace dccd
