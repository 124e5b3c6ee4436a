// The fields of a recording in the order of the file, for both directions.
#include "record/step_recording.h"

#include <cmath>
#include <cstring>
#include <tuple>
#include <type_traits>

#include "base/accuracy.h"
#include "base/contact_fields.h"
#include "record/recording_archive.h"
#include "step/option_rows.h"

namespace dccd {

namespace {

constexpr char MAGIC[8] = {'D', 'C', 'C', 'D', 'S', 'T', 'E', 'P'};
// What hostile options could cost: parts of a step, and buffers for so many workers.
constexpr std::size_t MAX_SUBSTEPS = 100000;
constexpr std::size_t MAX_BODIES = 65534;

enum class Connectivity : std::uint8_t { TRIANGLES = 0, POLYLINE = 1, EDGES = 2 };

// The least bytes that one item of a list takes.
constexpr std::size_t SEPARATION_BYTES = 10, BODY_BYTES = 64, WAYPOINT_BYTES = 144, MAPS_WAYPOINT_BYTES = 136,
                      CONTACT_BYTES = 51, INTERSECTION_BYTES = 25, EXPECTATION_BYTES = 32, PATCH_BYTES = 200,
                      TEXT_BYTES = 4;

template <typename Archive, typename Pose>
void visitPose(Archive& a, Pose& pose) {
  for (int i = 0; i < 16; ++i) {
    a.number(pose.matrix().data()[i]);
    if constexpr (Archive::READS) {
      if (!std::isfinite(pose.matrix().data()[i])) a.fail("a pose is not finite");
    }
  }
}

template <typename Archive, typename Expectations>
void visitExpectations(Archive& a, Expectations& expected) {
  a.count(expected, EXPECTATION_BYTES);
  for (auto& one : expected) {
    for (auto& partner : one.partners) {
      a.number(partner.body);
      a.array(partner.vertices);
      a.text(partner.set);
    }
    a.text(one.phase);
  }
}

template <typename Archive, typename Rung>
void visitRung(Archive& a, Rung& rung) {
  a.choice(rung, allRungs().back());
  if constexpr (Archive::READS) {
    if (rung < allRungs().front()) a.fail("rung " + std::to_string(static_cast<int>(rung)) + " does not exist");
  }
}

template <typename T>
constexpr bool IS_VECTOR = false;
template <typename T>
constexpr bool IS_VECTOR<std::vector<T>> = true;

/// What a byte of the file may be at most.
constexpr PairKind lastOf(PairKind) { return PairKind::FACE_VOXEL_CORNER; }
constexpr Certainty lastOf(Certainty) { return Certainty::UNDECIDED; }
constexpr BodyMotionKind lastOf(BodyMotionKind) { return BodyMotionKind::STATIC; }
constexpr StepStatus lastOf(StepStatus) { return StepStatus::INTERNAL_ERROR; }
constexpr StartState lastOf(StartState) { return StartState::NOT_CHECKED; }
constexpr Touching lastOf(Touching) { return Touching::EXPECTED; }

template <typename Archive, typename Contact>
void visitContact(Archive& a, Contact& c);

/// Each by its type.
template <typename Archive, typename... Values>
void visitValues(Archive& a, Values&... values);

template <typename Archive, typename Value>
void visitValue(Archive& a, Value& value) {
  using Type = std::remove_const_t<Value>;
  if constexpr (std::is_same_v<Type, bool>) {
    a.flag(value);
  } else if constexpr (std::is_same_v<Type, std::size_t>) {
    a.size(value);
  } else if constexpr (std::is_arithmetic_v<Type>) {
    a.number(value);
  } else if constexpr (std::is_same_v<Type, Accuracy>) {
    visitRung(a, value);
  } else if constexpr (std::is_enum_v<Type>) {
    a.choice(value, lastOf(value));
  } else if constexpr (std::is_same_v<Type, std::string>) {
    a.text(value);
  } else if constexpr (std::is_same_v<Type, VoxelKey>) {
    visitValues(a, value.x, value.y, value.z);
  } else if constexpr (std::is_same_v<Type, Vec3>) {
    visitValues(a, value.x(), value.y(), value.z());
  } else if constexpr (std::is_same_v<Type, Box>) {
    visitValues(a, value.min, value.max);
  } else if constexpr (std::is_same_v<Type, Contact>) {
    visitContact(a, value);
  } else if constexpr (std::is_same_v<Type, std::vector<Expectation>>) {
    visitExpectations(a, value);
  } else if constexpr (IS_VECTOR<Type>) {
    a.array(value);
  } else {
    for (auto& one : value) visitValue(a, one);
  }
}

template <typename Archive, typename... Values>
void visitValues(Archive& a, Values&... values) {
  (visitValue(a, values), ...);
}

template <typename Archive, bool RECORDED, typename Value>
void visitOptionOf(Archive& a, OptionRow<RECORDED, Value>& row) {
  if constexpr (RECORDED) visitValue(a, row.value);
}

template <typename Archive, typename Options>
void visitOptions(Archive& a, Options& options) {
  auto rows = optionRows(options);
  std::apply([&](auto&... row) { (visitOptionOf(a, row), ...); }, rows);
  if constexpr (Archive::READS) {
    if (options.max_substeps > MAX_SUBSTEPS) a.fail("max_substeps is " + std::to_string(options.max_substeps));
  }
}

void checkWaypoints(RecordingReader& a, const Body& body) {
  double before = 0;
  for (const Waypoint& point : body.waypoints) {
    if (!(point.u > before && point.u < 1)) a.fail("a waypoint is at " + std::to_string(point.u) + " of the step");
    if (point.positions->size() != (body.turns ? 0 : body.t0->size())) {
      a.fail("a waypoint of body '" + body.name + "' has " + std::to_string(point.positions->size()) + " vertices");
    }
    before = point.u;
  }
}

template <typename Archive, typename Body>
void visitBody(Archive& a, Body& body) {
  visitValues(a, body.name, body.motion, body.rigid, body.self_collision, body.against_bodies, body.against_obstacle,
              body.minimum_separation_m, body.vertex_mask);
  a.shared(body.t0);
  a.shared(body.t1);
  a.flag(body.turns);
  visitPose(a, body.pose_t0);
  visitPose(a, body.pose_t1);
  visitValues(a, body.shell, body.dropped_faces);
  a.count(body.waypoints, WAYPOINT_BYTES);
  for (auto& point : body.waypoints) {
    a.number(point.u);
    visitPose(a, point.pose);
    a.shared(point.positions);
  }
  if constexpr (Archive::READS) checkWaypoints(a, body);
}

template <typename Archive, typename Way>
void visitMapsWay(Archive& a, Way& way) {
  a.count(way, MAPS_WAYPOINT_BYTES);
  double before = 0;
  for (auto& point : way) {
    a.number(point.u);
    visitPose(a, point.pose);
    if constexpr (Archive::READS) {
      const bool is_last = &point == &way.back();
      if (!(point.u > before && (is_last ? point.u == 1 : point.u < 1))) {
        a.fail("the map's way has a pose at " + std::to_string(point.u) + " of the step");
      }
    }
    before = point.u;
  }
}

/// As Topology::polyline() makes it.
bool isPolyline(const Topology& topology) {
  const std::vector<Edge>& edges = topology.edges();
  for (Index i = 0; i < edges.size(); ++i) {
    if (edges[i] != Edge{i, i + 1}) return false;
  }
  return edges.size() + 1 == topology.vertexCount();
}

void visitTopology(RecordingWriter& a, const Body& body) {
  static const std::vector<Face> NONE;
  const Topology* const t = body.topology.get();
  const bool line = t && !t->hasFaces() && !t->edges().empty();
  const bool chain = line && isPolyline(*t);
  a.choice(chain ? Connectivity::POLYLINE : line ? Connectivity::EDGES : Connectivity::TRIANGLES, Connectivity::EDGES);
  a.array(t ? t->faces() : NONE);
  if (line && !chain) a.array(t->edges());
}

void visitTopology(RecordingReader& a, Body& body) {
  const std::size_t vertices = body.t0->size();
  if (vertices != body.t1->size()) {
    a.fail("body '" + body.name + "' has " + std::to_string(vertices) + " vertices at t=0 and " +
           std::to_string(body.t1->size()) + " at t=1");
  }
  Connectivity kind = Connectivity::TRIANGLES;
  std::vector<Face> faces;
  a.choice(kind, Connectivity::EDGES);
  a.array(faces);
  std::vector<Edge> edges;
  if (kind == Connectivity::EDGES) a.array(edges);
  try {
    body.topology =
        std::make_shared<const Topology>(kind == Connectivity::POLYLINE ? Topology::polyline(vertices)
                                         : kind == Connectivity::EDGES  ? Topology::fromEdges(vertices, edges)
                                                                        : Topology::fromTriangles(vertices, faces));
  } catch (const TopologyError& error) {
    a.fail("body '" + body.name + "': " + error.what());
  }
}

#define DCCD_VISIT_CONTACT(member, published) visitValue(a, c.member);
template <typename Archive, typename Contact>
void visitContact(Archive& a, Contact& c) {
  DCCD_CONTACT_FIELDS(DCCD_VISIT_CONTACT)
}

/// Which patches last is a matter of the stream, not of a step.
#define DCCD_VISIT_PATCH(member, published) visitValue(a, patch.member);
template <typename Archive, typename Answer>
void visitPatches(Archive& a, Answer& answer) {
  a.count(answer.patches, PATCH_BYTES);
  for (auto& patch : answer.patches) {
    DCCD_PATCH_FIELDS(DCCD_VISIT_PATCH, DCCD_VISIT_PATCH, DCCD_NO_FIELD)
  }
  a.array(answer.patch_of);
}

template <typename Archive, typename Sentences>
void visitSentences(Archive& a, Sentences& sentences) {
  a.count(sentences, TEXT_BYTES);
  for (auto& sentence : sentences) a.text(sentence);
}

/// A recording has in words what was said of the claim.
void visitClaim(RecordingWriter& a, const Outcome& answer) {
  const std::vector<std::string> missing = answer.missing();
  visitSentences(a, missing);
}
void visitClaim(RecordingReader& a, Outcome& answer) {
  std::vector<std::string> missing;
  visitSentences(a, missing);
  answer.claim = Claim::thatWasSaid(missing);
  answer.start_state_complete = answer.complete;
}

template <typename Archive, typename Answer>
void visitAnswer(Archive& a, Answer& answer) {
  visitValues(a, answer.status, answer.reason, answer.answered, answer.complete, answer.cut, answer.start_state,
              answer.touching, answer.total_contacts, answer.suppressed, answer.excluded_voxels, answer.substeps,
              answer.unchecked_toc_lower, answer.earliest_toc, answer.earliest_unexpected_toc);
  a.count(answer.contacts, CONTACT_BYTES);
  for (auto& contact : answer.contacts) visitContact(a, contact);
  a.count(answer.intersections, INTERSECTION_BYTES);
  for (auto& crossing : answer.intersections) visitValues(a, crossing.body, crossing.vertex, crossing.expected);
  visitClaim(a, answer);
  for (auto* sentences : {&answer.excluded, &answer.expected}) visitSentences(a, *sentences);
  visitPatches(a, answer);
}

template <typename Archive, typename Body>
void visitSeparations(Archive& a, Body& body) {
  a.count(body.separations, SEPARATION_BYTES, MAX_BODIES);
  for (auto& from : body.separations) visitValues(a, from.body, from.separation_m);
  a.array(body.not_against);
  a.shared(body.radius_m);
}

void visitReference(RecordingWriter& a, const Body& body) {
  a.flag(body.reference != nullptr);
  if (!body.reference) return;
  a.array(*body.reference);
}

void visitReference(RecordingReader& a, Body& body) {
  const std::size_t vertices = body.t0->size();
  if (body.radius_m->empty()) {
    body.radius_m = nullptr;
  } else if (body.radius_m->size() != vertices) {
    a.fail("body '" + body.name + "' has " + std::to_string(body.radius_m->size()) + " radii");
  }
  bool present = false;
  a.flag(present);
  if (!present) return;
  Positions reference;
  a.array(reference);
  if (reference.size() != vertices) {
    a.fail("the reference frame of body '" + body.name + "' has " + std::to_string(reference.size()) + " vertices");
  }
  body.reference = share(std::move(reference));
}

/// The file's fields in their order, for both directions.
template <typename Archive, typename Recording>
void visit(Archive& a, Recording& r) {
  visitValues(a, r.note, r.step.sequence, r.step.start_ns, r.step.stamp_ns, r.step.off_path);
  if constexpr (Archive::READS) {
    if (r.step.start_ns < 0 || r.step.stamp_ns <= r.step.start_ns) {
      a.fail("the step lasts from " + std::to_string(r.step.start_ns) + " ns to " + std::to_string(r.step.stamp_ns) +
             " ns");
    }
  }
  visitOptions(a, r.options);
  a.count(r.step.bodies, BODY_BYTES, MAX_BODIES);
  for (auto& body : r.step.bodies) {
    visitBody(a, body);
    visitTopology(a, body);
    visitSeparations(a, body);
    visitReference(a, body);
  }
  a.map(r.step.map.surface);
  a.number(r.step.map.stamp_ns);
  visitPose(a, r.step.map.map_from_fixed);
  visitMapsWay(a, r.step.map.way);
  auto& own = r.step.map.own;
  visitValues(a, r.step.map.problem, own.looked_at, own.own, own.doubted, own.excluded, own.doubt, r.has_answer);
  visitAnswer(a, r.answer);
}

template <typename Visit>
std::vector<std::uint8_t> bytesOf(const Visit& visit) {
  std::vector<std::uint8_t> all;
  const TakeBytes append = [&](const void* data, std::size_t size) {
    const auto* bytes = static_cast<const std::uint8_t*>(data);
    all.insert(all.end(), bytes, bytes + size);
  };
  RecordingWriter writer(append);
  visit(writer);
  return all;
}

}  // namespace

void serialise(const StepRecording& recording, const TakeBytes& take) {
  RecordingWriter writer(take);
  for (const char c : MAGIC) writer.number(c);
  writer.number(RECORDING_VERSION);
  visit(writer, recording);
}

std::vector<std::uint8_t> recordedBytes(const Contact& contact) {
  return bytesOf([&](RecordingWriter& writer) { visitContact(writer, contact); });
}

std::vector<std::uint8_t> recordedBytes(const Outcome& answer) {
  return bytesOf([&](RecordingWriter& writer) { visitAnswer(writer, answer); });
}

StepRecording readRecording(const void* data, std::size_t size, const std::string& name) {
  RecordingReader reader(data, size, name);
  char magic[sizeof MAGIC] = {};
  if (size < sizeof magic) reader.fail("too short for a recording of a step");
  reader.bytes(magic, sizeof magic);
  if (std::memcmp(magic, MAGIC, sizeof magic) != 0) reader.fail("not a recording of a step");
  std::uint32_t version = 0;
  reader.number(version);
  if (version != RECORDING_VERSION) {
    reader.fail("version " + std::to_string(version) + " of the format, and this program reads version " +
                std::to_string(RECORDING_VERSION) +
                " alone; record the step again, or replay it by the program that recorded it");
  }
  StepRecording recording;
  visit(reader, recording);
  if (reader.left() > 0) reader.fail(std::to_string(reader.left()) + " bytes are left over");
  return recording;
}

}  // namespace dccd
