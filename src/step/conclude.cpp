#include "step/conclude.h"

#include <algorithm>
#include <cmath>
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

/// Is every vertex on an edge or a face left out? Then nothing of the body was looked at.
bool isMaskedWhole(const Body& body) {
  const std::vector<Index>& used = body.topology->usedVertices();
  if (body.vertex_mask.empty() || body.vertex_mask.size() < used.size()) return false;
  std::vector<bool> masked(body.topology->vertexCount());
  for (const Index v : body.vertex_mask) masked.at(v) = true;
  return std::all_of(used.begin(), used.end(), [&](Index v) { return masked[v]; });
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
  return text.str().empty() ? "a rigid body turns far" : text.str();
}

/// Why it is less than a whole answer, if it is. Reasons come in ascending order of weight, and the last one gives the
/// status; each that stands in the way of a proof also goes into `unproved`.
void judge(const Options& options, const Step& step, std::size_t needed_parts, Outcome& outcome) {
  outcome.status = StepStatus::OK;
  const auto say = [&](StepStatus status, const std::string& reason) {
    outcome.status = status;
    outcome.reason = reason;
    // A list that is cut says nothing wrong about what touches, and all of it was looked at.
    if (status != StepStatus::TRUNCATED) outcome.unproved.push_back(reason);
  };
  if (const std::string text = takeUnchecked(step, outcome.stats); !text.empty()) say(StepStatus::PARTIAL, text);
  if (!step.off_path.empty()) say(StepStatus::PARTIAL, step.off_path);
  if (outcome.contacts.size() < outcome.total_contacts) {
    say(StepStatus::TRUNCATED, "the earliest " + std::to_string(outcome.contacts.size()) + " of " +
                                   std::to_string(outcome.total_contacts) + " contacts are listed");
  }
  const auto notBefore = [&] {  // rounded down, as the bound is
    const double toc = outcome.unchecked_toc_lower, millionths = std::floor(toc * 1e6);
    // The product may have been rounded up to a whole number; what fma() leaves has its true sign.
    const double below = std::fma(toc, 1e6, -millionths) < 0 ? millionths - 1 : millionths;
    return "nothing that was left out touches before toc " + std::to_string(below / 1e6);
  };
  const std::string ran_out =
      options.step_budget_ms > 0 ? "the step budget ran out" : "the time that a step may take without a budget ran out";
  if (outcome.cut) {
    const std::string text = "at least " + std::to_string(outcome.total_contacts) +
                             " contacts; the work was cut at the limit of what a step may find; " +
                             (outcome.allPairs() ? "not all of the start state was looked at" : notBefore());
    // Not by say(): unlike a list that is cut, this TRUNCATED means that not everything was looked at.
    outcome.status = StepStatus::TRUNCATED;
    outcome.reason = text;
    outcome.unproved.push_back(text);
  } else if (!outcome.complete && !outcome.allPairs()) {
    say(StepStatus::DEADLINE, ran_out + "; " + notBefore());
  } else if (!outcome.complete) {
    say(StepStatus::DEADLINE,
        ran_out + " before all of the start state was looked at; no pair was left out of the contacts");
  }
  if (outcome.substeps < needed_parts) {
    say(StepStatus::PARTIAL,
        waysInWords(step) + ", so that " +
            (needed_parts == NO_NUMBER_OF_PARTS ? std::string("no number of equal parts follows it")
                                                : std::to_string(needed_parts) + " parts are needed") +
            "; max_substeps is " + std::to_string(outcome.substeps));
  }
  if (options.obstacle_expected && !step.map.surface) {
    say(StepStatus::NO_MAP, step.map.problem + "; checked without it");
  }
  // None of these changes the status: the step was computed as it was asked for.
  if (!step.map.own.doubt.empty()) outcome.unproved.push_back(step.map.own.doubt);
  for (const Body& body : step.bodies) {
    if (!isMaskedWhole(body)) continue;
    outcome.unproved.push_back("vertex_mask names every vertex of body '" + body.name +
                               "', so nothing of it was checked");
  }
  if (outcome.start_state == StartState::NOT_CHECKED && outcome.start_state_complete) {
    outcome.unproved.push_back("whether surfaces cross at the start was not checked");
  }
}

/// What nobody looked at. Where time or a limit left something out, that was said.
void sayGaps(const Step& step, Outcome& outcome) {
  if (outcome.claim.holds() || outcome.cut || !outcome.complete) return;
  outcome.complete = false;
  std::vector<std::string> names;
  for (const Body& body : step.bodies) names.push_back(body.name);
  for (std::string& sentence : outcome.claim.inWords(names)) outcome.unproved.push_back(std::move(sentence));
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
    std::string names;
    std::size_t count = 0;
    for (const Body& body : step.bodies) {
      if (!holds(body) || body.topology->vertexCount() == 0) continue;
      names.append(names.empty() ? "'" : ", '").append(body.name).append("'");
      ++count;
    }
    if (count > 0) excluded.push_back((count == 1 ? "body " : "bodies ") + names + ": " + what);
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

}  // namespace

std::uint64_t looseVertices(const Body& body) {
  const Topology& topology = *body.topology;
  const std::size_t used = topology.usedVertices().size();
  if (used == topology.vertexCount() || (body.rigid && used > 0)) return 0;
  std::vector<bool> accounted(topology.vertexCount());
  for (const Index v : topology.usedVertices()) accounted[v] = true;
  for (const Index v : body.vertex_mask) accounted.at(v) = true;
  return static_cast<std::uint64_t>(std::count(accounted.begin(), accounted.end(), false));
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
  sayGaps(step, outcome);
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
