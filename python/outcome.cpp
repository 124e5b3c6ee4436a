// Outcome: what a step was answered, as numpy arrays that show the core's own memory.
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <functional>
#include <string_view>

#include "base/contact_fields.h"
#include "dccd/assurance.h"
#include "module.h"

namespace dccd {
namespace python {

namespace {

// What numpy calls a field's type.
constexpr const char* typeOf(const double&) { return "f8"; }
constexpr const char* typeOf(const std::uint32_t&) { return "u4"; }
constexpr const char* typeOf(const std::uint64_t&) { return "u8"; }
constexpr const char* typeOf(const StampNs&) { return "i8"; }
constexpr const char* typeOf(const bool&) { return "?"; }
constexpr const char* typeOf(const Certainty&) { return "?"; }
constexpr const char* typeOf(const PairKind&) { return "u1"; }
constexpr const char* typeOf(const PatchBeginning&) { return "u1"; }
constexpr const char* typeOf(const std::array<Index, 4>&) { return "(4,)u4"; }
constexpr const char* typeOf(const std::array<std::uint16_t, 2>&) { return "(2,)u2"; }
constexpr const char* typeOf(const VoxelKey&) { return "(3,)u2"; }
const char* typeOf(const Vec3&) { return "(3,)f8"; }
const char* typeOf(const Box&) { return "(2,3)f8"; }

const char* nameOf(const char* member) {
  const std::string_view name = member;
  return name == "body" ? "bodies" : name == "vertex" ? "vertices" : name == "certainty" ? "certain" : member;
}

#define DCCD_ARRAY_FIELD(member, published) {nameOf(#member), typeOf(Row().member), offsetof(Row, member)},

const py::dtype& contactType() {
  static_assert(sizeof(Certainty) == 1 && sizeof(PairKind) == 1);
  using Row = Contact;
  static const py::dtype* type = nullptr;
  return onceMade(type, [] { return structured({DCCD_CONTACT_FIELDS(DCCD_ARRAY_FIELD)}, sizeof(Row)); });
}

const py::dtype& intersectionType() {
  static const py::dtype* type = nullptr;
  return onceMade(type, [] {
    return structured({{"bodies", "(2,)u2", offsetof(StartIntersection, body)},
                       {"vertices", "(5,)u4", offsetof(StartIntersection, vertex)},
                       {"expected", "?", offsetof(StartIntersection, expected)}},
                      sizeof(StartIntersection));
  });
}

const py::dtype& patchType() {
  using Row = Patch;
  static const py::dtype* type = nullptr;
  return onceMade(type, [] { return structured({DCCD_PUBLISHED_PATCH_FIELDS(DCCD_ARRAY_FIELD)}, sizeof(Row)); });
}

const py::dtype& clearanceType() {
  static_assert(sizeof(ClearanceStatus) == 1);
#define DCCD_DISTANCE(prefix, distance)                                                                    \
  {prefix "status", "u1", offsetof(Clearance, distance) + offsetof(ClearanceDistance, status)},            \
      {prefix "lower_m", "f8", offsetof(Clearance, distance) + offsetof(ClearanceDistance, lower_m)},      \
      {prefix "upper_m", "f8", offsetof(Clearance, distance) + offsetof(ClearanceDistance, upper_m)},      \
      {prefix "t", "f8", offsetof(Clearance, distance) + offsetof(ClearanceDistance, t)},                  \
      {prefix "points", "(2,3)f8", offsetof(Clearance, distance) + offsetof(ClearanceDistance, point)},    \
      {prefix "vertices", "(2,3)u4", offsetof(Clearance, distance) + offsetof(ClearanceDistance, vertex)}, \
      {prefix "voxel", "(3,)u2", offsetof(Clearance, distance) + offsetof(ClearanceDistance, voxel)}, {    \
    prefix "voxel_size", "u4", offsetof(Clearance, distance) + offsetof(ClearanceDistance, voxel_size)     \
  }
  static const py::dtype* type = nullptr;
  return onceMade(type, [] {
    return structured({{"bodies", "(2,)u2", offsetof(Clearance, body)},
                       {"expected", "?", offsetof(Clearance, expected)},
                       DCCD_DISTANCE("end_", at_end),
                       DCCD_DISTANCE("step_", over_step)},
                      sizeof(Clearance));
  });
#undef DCCD_DISTANCE
}

const py::dtype& geometryType() {
  static const py::dtype* type = nullptr;
  return onceMade(type, [] {
    return structured({{"point", "(3,)f8", offsetof(ContactGeometry, point)},
                       {"normal", "(3,)f8", offsetof(ContactGeometry, normal)},
                       {"weights", "(4,)f8", offsetof(ContactGeometry, weights)},
                       {"approach_speed", "f8", offsetof(ContactGeometry, approach_speed)}},
                      sizeof(ContactGeometry));
  });
}

/// Zeros for what lies between the fields of its rows: equal answers have equal bytes, in a file as well.
template <class T>
void clearGaps(const py::dtype& type, std::vector<T>& rows) {
  struct Gap {
    std::size_t begin, bytes;
  };
  static const std::vector<Gap>* made = nullptr;
  const std::vector<Gap>& gaps_of_row = onceMade(made, [&type] {
    std::vector<Gap> gaps;
    std::size_t end = 0;
    const auto gapTo = [&](std::size_t begin) {
      if (begin > end) gaps.push_back({end, begin - end});
    };
    for (const py::handle name : type.attr("names")) {
      const py::tuple field = type.attr("fields")[name];
      gapTo(field[1].cast<std::size_t>());
      end = field[1].cast<std::size_t>() + field[0].attr("itemsize").cast<std::size_t>();
    }
    gapTo(sizeof(T));
    return gaps;
  });
  for (T& row : rows) {
    for (const Gap& gap : gaps_of_row) std::memset(reinterpret_cast<char*>(&row) + gap.begin, 0, gap.bytes);
  }
}

template <class T>
py::array rowsOf(const py::dtype& type, const std::vector<T>& rows, py::handle answer) {
  return readOnly(type, {static_cast<py::ssize_t>(rows.size())}, rows.data(), answer);
}

py::array geometryOf(const Answer& answer, py::object indices) {
  const Outcome& outcome = answer.outcome();
  std::vector<Index> chosen;
  if (indices.is_none()) {
    for (std::size_t i = 0; i < outcome.contacts.size(); ++i) chosen.push_back(static_cast<Index>(i));
  } else {
    chosen = verticesOf(indices, "indices");
  }
  py::array made(geometryType(), static_cast<py::ssize_t>(chosen.size()));
  auto* at = static_cast<ContactGeometry*>(made.mutable_data());
  for (const Index i : chosen) {
    if (i >= outcome.contacts.size()) {
      throw py::index_error("there is no contact " + std::to_string(i) + "; there are " +
                            std::to_string(outcome.contacts.size()));
    }
    *at++ = contactGeometry(outcome, outcome.contacts[i]);
  }
  return made;
}

py::dict countsOf(const Answer& answer) {
  const ContactCounts& c = answer.outcome().counts;
  using namespace py::literals;
  return py::dict("certain"_a = c.certain, "undecided"_a = c.undecided, "initial"_a = c.initial,
                  "leaving"_a = c.leaving, "mesh"_a = c.mesh, "obstacle"_a = c.obstacle, "expected"_a = c.expected,
                  "expected_initial"_a = c.expected_initial);
}

template <class Kind, std::size_t N>
py::dict tableOf(const std::array<StageStats, N>& rows) {
  using namespace py::literals;
  py::dict table;
  for (std::size_t i = 0; i < N; ++i) {
    table[toString(static_cast<Kind>(i))] = py::dict("in"_a = rows[i].in, "out"_a = rows[i].out, "ms"_a = rows[i].ms);
  }
  return table;
}

py::dict statsOf(const Answer& answer) {
  const StepStats& stats = answer.outcome().stats;
  py::dict all, tiers;
  all["total_ms"] = stats.total_ms;
  all["stages"] = tableOf<Stage>(stats.stages);
  all["effects"] = tableOf<Effect>(stats.effects);
  for (std::size_t t = 0; t < stats.tiers.settled.size(); ++t) {
    tiers[toString(static_cast<Tier>(t))] = stats.tiers.settled[t];
  }
  all["tiers"] = tiers;
  for (const StepCounter& counter : STEP_COUNTERS) all[counter.name] = stats.*counter.value;
  return all;
}

py::list eventsOf(const Answer& answer) {
  using namespace py::literals;
  py::list events;
  const auto stampOf = [](StampNs stamp_ns) {
    return stamp_ns == UNKNOWN_NS ? py::object(py::none()) : py::object(py::int_(stamp_ns));
  };
  for (const PatchEvent& e : answer.outcome().patch_events) {
    events.append(py::dict("kind"_a = toString(e.kind), "id"_a = e.id, "others"_a = e.others, "bodies"_a = e.body,
                           "beginning"_a = toString(e.beginning), "expected"_a = e.expected,
                           "from_ns"_a = stampOf(e.from_ns), "to_ns"_a = stampOf(e.to_ns)));
  }
  return events;
}

std::vector<std::string> namesOf(const Answer& answer) {
  std::vector<std::string> names;
  if (!answer.outcome().step) return names;
  for (const Body& body : answer.outcome().step->bodies) names.push_back(body.name);
  return names;
}

const char* const OUTCOME_DOC = R"(What a step was answered. Times of contact (toc) are fractions of the step, 0 to 1.

An empty list of contacts means "no contact" only where `proved` is True. All arrays are read-only views of the
outcome's own memory; copy one to change it.

The fields of `contacts`, a row each, sorted by kind, bodies, vertices:

    toc_lower   float64     with 'exact' the true time of contact is in [toc_lower, toc_upper), or both are 1 where
    toc_upper   float64     it is 1
    vertices    uint32[4]   of the two features, each counted within its body. VERTEX_FACE: the vertex, then the
                            face's three; EDGE_EDGE: two and two; dccd.NO_INDEX where a kind has fewer
    bodies      uint16[2]   places in the list of bodies; dccd.OBSTACLE_BODY: the voxels
    voxel       uint16[3]   with the voxels: smallest key of the cube, and its edge length in finest voxels
    voxel_size  uint32
    kind        uint8       dccd.VERTEX_FACE (0), EDGE_EDGE, VERTEX_VOXEL_FACE, EDGE_VOXEL_EDGE or
                            FACE_VOXEL_CORNER (4); dccd.KINDS has their names
    certain     bool        False: undecided; a contact, if there is one, is not before toc_lower
    initial     bool        the features touch when the step begins
    leaving     bool        on its way out of a voxel that it was in when the step began
    expected    bool        by the option `expected`)";

template <class Class>
void bindAnswer(Class& c) {
  const auto array = [&](const char* name, const py::dtype& (*type)(), auto Outcome::*rows, const char* doc) {
    c.def_property_readonly(
        name,
        [type, rows](py::object self) { return rowsOf(type(), self.cast<const Answer&>().outcome().*rows, self); },
        doc);
  };
  array("contacts", &contactType, static_cast<std::vector<Contact> Outcome::*>(&Outcome::contacts),
        "structured array: the contacts, see help(dccd.Outcome)");
  array("intersections", &intersectionType,
        static_cast<std::vector<StartIntersection> Outcome::*>(&Outcome::intersections),
        "structured array: what crosses when the step begins. bodies, vertices: an edge (2) of the first body and a "
        "face (3) of the second; a vertex of the first inside of the second, or of the voxels, the others "
        "dccd.NO_INDEX; expected");
  array("patches", &patchType, &Outcome::patches,
        "structured array, with the option patches: which contacts belong together, by their first contact. bodies; "
        "how many contacts, certain, initial, expected, crossings; toc_lower, toc_upper of the first touch; area_m2, "
        "centroid [m], normal, box (min and max [m]); in a Stream id, which lasts from step to step, is_new, beginning "
        "(0: NEW, 1: INITIAL, 2: MAP_CHANGED), and began_from_ns and began_to_ns, between which it began; the least "
        "int64: nobody knows");
  array(
      "clearances", &clearanceType, &Outcome::clearances,
      "structured array, with the option clearance: how far apart each two partners are. bodies (the same twice: "
      "itself), expected; at the step's end (end_...) and the smallest over the step (step_...): status (0: MEASURED, "
      "1: FARTHER, 2: TOUCHING, 3: LOWER, 4: UNKNOWN), lower_m <= truth <= upper_m (inf: nobody knows), t where "
      "upper_m was taken, points [m], vertices of their features, voxel, voxel_size");
  c.def_property_readonly(
      "patch_of",
      [](py::object self) {
        return rowsOf(py::dtype::of<std::uint32_t>(), self.cast<const Answer&>().outcome().patch_of, self);
      },
      "uint32 array, with the option patches: each contact's place in `patches`");
}

template <class Class>
void bindJudgement(Class& c) {
  const auto judged = [&](const char* name, auto valueOf, const char* doc) {
    c.def_property_readonly(
        name, [valueOf](const Answer& a) { return std::invoke(valueOf, assuranceOf(a.outcome())); }, doc);
  };
  judged("proved", &Assurance::proved,
         "bool: everything was shown: what is not in `contacts` does not touch, and the start state is known");
  judged("missing", &Assurance::missing, "list of str: why it is not proved, a sentence each; empty where it is");
  judged("excluded", &Assurance::excluded,
         "list of str: what was left out by choice, a sentence each; takes nothing from `proved`");
  judged("expected", &Assurance::expected,
         "list of str: which contacts are expected, whether or not there are any, a sentence each");
  judged(
      "touching", [](const Assurance& a) { return std::string(toString(a.touching)); },
      "str, the first that holds: NEW: something touches that is not expected and is an alarm (in a Stream with "
      "patches: "
      "of a patch that is_new; else a contact that is not initial); LASTING: something touches, or crossed when the "
      "step "
      "began, that is not expected (in a Stream it may have come apart for less than patch_gap_s); EXPECTED: all that "
      "touches is expected; NONE. What could not be ruled out counts as touching");
  judged("clear", &Assurance::clear, "bool: proved, and nothing touches");
  c.def("__str__", [](const Answer& a) { return describe(assuranceOf(a.outcome())); });
  c.def("__repr__", [](const Answer& a) {
    return "<dccd.Outcome " + std::string(toString(a.outcome().status)) + ": " +
           std::to_string(a.outcome().contacts.size()) + " contacts; " + describe(assuranceOf(a.outcome())) + ">";
  });
}

template <class Class>
void bindValues(Class& c) {
  const auto plain = [&](const char* name, auto valueOf, const char* doc) {
    c.def_property_readonly(
        name, [valueOf](const Answer& a) { return std::invoke(valueOf, a.outcome()); }, doc);
  };
  plain(
      "status", [](const Outcome& o) { return std::string(toString(o.status)); },
      "str: OK, PARTIAL (something is unchecked), DEADLINE (the budget ran out), TRUNCATED (there is more than the "
      "limits allow), NO_MAP; of a Stream also why there is no answer (FIRST_FRAME, GAP, TELEPORT ...)");
  plain("reason", &Outcome::reason, "str: one sentence; empty where the status is OK");
  plain("answered", &Outcome::answered, "bool: there is a result");
  c.def_property_readonly("body_names", &namesOf, "list of str: by the numbers in `bodies`");
  plain(
      "start_state", [](const Outcome& o) { return std::string(toString(o.start_state)); },
      "str: CLEAR, INTERSECTING (surfaces cross, or a body is inside of another one, when the step begins) or "
      "NOT_CHECKED");
  plain("start_state_complete", &Outcome::start_state_complete,
        "bool: False: the budget ran out before all that can meet at the start was looked at");
  plain("complete", &Outcome::complete, "bool: False: the budget or a limit ended the step early");
  plain("unchecked_toc_lower", &Outcome::unchecked_toc_lower,
        "float: pairs were left out, none of which can touch before this; inf: none were");
  plain("earliest_toc", &Outcome::earliest_toc,
        "float: nothing touches before this, undecided and unchecked pairs included; inf: nothing touches");
  plain("earliest_unexpected_toc", &Outcome::earliest_unexpected_toc, "float: the same without what is expected");
  plain("total_contacts", &Outcome::total_contacts, "int: before the cut to max_contacts");
  plain("suppressed", &Outcome::suppressed, "int: initial contacts left out by choice");
  plain("substeps", &Outcome::substeps,
        "int: parts that the step was cut into, for bodies that turn or have waypoints");
  plain("excluded_voxels", &Outcome::excluded_voxels, "int: finest voxels taken out by exclude_boxes");
  plain("start_ns", &Outcome::start_ns, "int: stamp of the step's start [ns], in a Stream");
  plain("stamp_ns", &Outcome::stamp_ns, "int: stamp of the step's end [ns], in a Stream");
  plain("sequence", &Outcome::sequence, "int: of the frames of a Stream's clock body, from 1");
}

}  // namespace

Answer::Answer(Outcome outcome) : outcome_(std::move(outcome)) {
  // Numpy shows the byte as the bool `certain`, of which Certainty has the contrary.
  static_assert(static_cast<int>(Certainty::CERTAIN) == 0 && static_cast<int>(Certainty::UNDECIDED) == 1);
  for (Contact& contact : outcome_.contacts) {
    contact.certainty = contact.certainty == Certainty::CERTAIN ? Certainty::UNDECIDED : Certainty::CERTAIN;
  }
  clearGaps(contactType(), outcome_.contacts);
  clearGaps(intersectionType(), outcome_.intersections);
  clearGaps(patchType(), outcome_.patches);
  clearGaps(clearanceType(), outcome_.clearances);
}

void bindOutcome(py::module_& m) {
  auto c = bindClass<Answer>(m, "Outcome", OUTCOME_DOC);
  bindAnswer(c);
  bindJudgement(c);
  bindValues(c);
  c.def_property_readonly("counts", &countsOf,
                          "dict of int: of how many of all contacts what holds (certain, undecided, initial, leaving, "
                          "mesh, obstacle, expected, expected_initial)");
  c.def_property_readonly("stats", &statsOf,
                          "dict: what the step cost: total_ms; stages, effects (pairs in and out, ms); tiers; counters "
                          "(doc/interface.md, Effects)");
  c.def_property_readonly("patch_events", &eventsOf,
                          "list of dict, of a Stream with the option patches: what patches BEGAN, ENDED, SPLIT, "
                          "MERGED, are UNEXPECTED now; from_ns and to_ns: between which stamps, None: nobody knows");
  c.def("geometry", &geometryOf, py::arg("indices") = py::none(),
        "geometry(self, indices=None)\n--\n\n"
        "Where and how contacts touch at toc_lower, rounded: for display and control.\n\n"
        "Parameters\n----------\nindices : (k,) integers\n    Places in `contacts`; all of them if left out.\n\n"
        "Returns\n-------\nstructured array\n"
        "    point [m]; normal, unit, from the second feature towards the first; weights (VERTEX_FACE: 1, then the\n"
        "    face's barycentric; EDGE_EDGE: along each edge); approach_speed [m per step], above 0 when closing.\n\n"
        "Raises\n------\nIndexError\n    There is no such contact.");
}

}  // namespace python
}  // namespace dccd
