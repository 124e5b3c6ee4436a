// Body, and bodies by name and number.
#include <algorithm>
#include <cmath>

#include "dccd/tolerances.h"
#include "module.h"

namespace dccd {
namespace python {

namespace {

void setPositions(Body& body, std::shared_ptr<const Positions> positions, const char* name, bool at_start) {
  if (positions->size() != body.topology->vertexCount()) {
    throw py::value_error(std::string(name) + " has " + std::to_string(positions->size()) +
                          " positions; the mesh has " + std::to_string(body.topology->vertexCount()) + " vertices");
  }
  (at_start ? body.t0 : body.t1) = std::move(positions);
}

void setT0(NamedBody& body, py::handle value) { setPositions(body.body, positionsOf(value, "t0"), "t0", true); }
void setT1(NamedBody& body, py::handle value) { setPositions(body.body, positionsOf(value, "t1"), "t1", false); }

void moveTo(NamedBody& body, py::handle value) {
  if (body.body.turns) throw py::value_error("move_to() tells no pose; make a new Body with pose_t0 and pose_t1");
  std::shared_ptr<const Positions> before = body.body.t1;
  setPositions(body.body, positionsOf(value, "positions"), "positions", false);
  body.body.t0 = before ? before : body.body.t1;
}

TopologyPtr meshOfBody(const std::shared_ptr<const Positions>& t0, py::handle triangles, py::handle edges,
                       const TopologyPtr& mesh) {
  if (mesh) {
    if (!triangles.is_none() || !edges.is_none()) throw py::type_error("expected a mesh, or triangles, or edges");
    return mesh;
  }
  if (!t0) throw py::type_error("a body without t0 needs mesh=dccd.Mesh(vertex_count, triangles)");
  return meshOf(t0->size(), triangles, edges);
}

void setPoses(Body& body, py::handle pose_t0, py::handle pose_t1) {
  if (pose_t0.is_none() != pose_t1.is_none()) throw py::type_error("pose_t0 and pose_t1 go together");
  if (pose_t0.is_none()) return;
  body.pose_t0 = poseOf(pose_t0, "pose_t0");
  body.pose_t1 = poseOf(pose_t1, "pose_t1");
  body.turns = true;
  if (body.t0) requireMoved(*body.t0, body.pose_t1 * body.pose_t0.inverse(), *body.t1, "t1");
}

NamedBody makeBody(py::object t0, py::object t1, py::object triangles, py::object edges, const TopologyPtr& mesh,
                   const std::string& name, bool rigid, bool fixed, bool self_collision, bool against_bodies,
                   bool against_obstacle, bool shell, double minimum_separation_m, py::object vertex_mask,
                   const std::map<std::string, double>& separations_m, py::object reference, py::object radius_m,
                   py::object pose_t0, py::object pose_t1, const py::kwargs& others) {
  if (!others.empty()) refuseBodyOption(py::str(others.begin()->first));
  NamedBody made;
  Body& body = made.body;
  const std::shared_ptr<const Positions> start = t0.is_none() ? nullptr : positionsOf(t0, "t0");
  body.topology = meshOfBody(start, triangles, edges, mesh);
  if (start) setPositions(body, start, "t0", true);
  body.t1 = body.t0;
  if (!t1.is_none()) setT1(made, t1);
  body.name = name;
  body.motion = fixed ? BodyMotionKind::STATIC : BodyMotionKind::STREAM;
  body.rigid = rigid;
  body.self_collision = self_collision;
  body.against_bodies = against_bodies;
  body.against_obstacle = against_obstacle;
  body.shell = shell;
  body.minimum_separation_m = minimum_separation_m;
  if (!vertex_mask.is_none()) body.vertex_mask = verticesOf(vertex_mask, "vertex_mask");
  if (!reference.is_none()) body.reference = positionsOf(reference, "reference");
  if (!radius_m.is_none()) {
    body.radius_m = radiiOf(radius_m, "radius_m");
    if (body.radius_m->size() != body.topology->vertexCount()) {
      throw py::value_error("radius_m has " + std::to_string(body.radius_m->size()) + " radii; the mesh has " +
                            std::to_string(body.topology->vertexCount()) + " vertices");
    }
  }
  setPoses(body, pose_t0, pose_t1);
  made.separations_m = separations_m;
  return made;
}

const char* const BODY_DOC = R"(A body: its mesh, how it is tested, and where it is at both ends of a step.

Body(t0=None, t1=None, triangles=None, *, edges=None, mesh=None, name='', ...)

Parameters
----------
t0, t1 : (n, 3) float64 [m]
    Positions at the start and at the end of the step; each vertex moves straight between them. Without t1 the body
    rests. Without t0 it has no place yet, as for a Stream. They are copied, once and as a whole: another dtype than
    float64, or another order than C, costs a second copy. A position that is NaN or infinite leaves its vertex
    unchecked, and then nothing is proved.
triangles, edges, mesh : (m, 3) integers, (m, 2) integers, or Mesh
    One of the three.
name : str
    For sentences, separations_m and expected contacts. Without one it is body_0, body_1 ... by its place.
rigid : bool
    It is never tested against itself.
static : bool
    In a Stream: its newest positions hold at all times.
self_collision, against_bodies, against_obstacle : bool
    Whether it is tested against itself, other bodies, the voxels.
shell : bool
    A container: closed, but others may be inside of it.
minimum_separation_m : float
    What comes closer than this [m] counts as contact; of two bodies the larger one. Needs accuracy='conservative'.
vertex_mask : (k,) integers
    Vertices that are left out with every feature on them, as those that a gripper holds.
separations_m : dict
    From a body's name, 'self' or 'octomap' to the separation [m] that takes the place of minimum_separation_m there.
reference : (n, 3) float64 [m]
    Where the body was fit: features that are closer there than the separation are neighbours, no contact.
radius_m : (n,) float64 [m]
    How far off each position may be; adds to the separation. Needs accuracy='conservative'.
pose_t0, pose_t1 : (4, 4) float64
    fixed_from_body at both ends: the body moves along the rotation between them, and t1 is where it ends.

Raises
------
TypeError
    An argument has a dtype or a type that it cannot have.
ValueError
    A shape, an index or a number does not fit.)";

py::object radiiArray(const std::shared_ptr<const std::vector<double>>& radii) {
  if (!radii) return py::none();
  return sharedArray(radii, py::dtype::of<double>(), {static_cast<py::ssize_t>(radii->size())});
}

template <class Class>
void bindWhatItIs(Class& c) {
  const auto plain = [&](const char* name, auto Body::*field, const char* doc) {
    c.def_property_readonly(
        name, [field](const NamedBody& b) { return b.body.*field; }, doc);
  };
  plain("name", &Body::name, "str: its name");
  plain("rigid", &Body::rigid, "bool: it is never tested against itself");
  plain("self_collision", &Body::self_collision, "bool: it is tested against itself");
  plain("against_bodies", &Body::against_bodies, "bool: it is tested against other bodies");
  plain("against_obstacle", &Body::against_obstacle, "bool: it is tested against the voxels");
  plain("shell", &Body::shell, "bool: others may be inside of it");
  plain("minimum_separation_m", &Body::minimum_separation_m, "float: what comes closer [m] counts as contact");
  c.def_property_readonly(
      "static", [](const NamedBody& b) { return b.body.motion == BodyMotionKind::STATIC; },
      "bool: in a Stream its newest positions hold at all times");
  c.def_property_readonly(
      "separations_m", [](const NamedBody& b) { return b.separations_m; },
      "dict: separations [m] by the others' names");
  c.def_property_readonly(
      "vertex_mask",
      [](const NamedBody& b) {
        const std::vector<Index>& mask = b.body.vertex_mask;
        return py::array_t<Index>(static_cast<py::ssize_t>(mask.size()), mask.data());
      },
      "(k,) uint32: vertices that are left out");
  c.def_property_readonly(
      "reference", [](const NamedBody& b) { return arrayOf(b.body.reference); },
      "(n, 3) float64 [m], read-only: where it was fit; None: nowhere");
  c.def_property_readonly(
      "radius_m", [](const NamedBody& b) { return radiiArray(b.body.radius_m); },
      "(n,) float64 [m], read-only: how far off each position may be; None: they are exact");
  const auto pose = [&](const char* name, Eigen::Isometry3d Body::*field, const char* doc) {
    c.def_property_readonly(
        name, [field](const NamedBody& b) { return b.body.turns ? py::object(matrixOf(b.body.*field)) : py::none(); },
        doc);
  };
  pose("pose_t0", &Body::pose_t0, "(4, 4) float64: fixed_from_body at the start; None: it does not turn");
  pose("pose_t1", &Body::pose_t1, "(4, 4) float64: fixed_from_body at the end; None: it does not turn");
}

/// SeparationFrom by number.
std::vector<SeparationFrom> separationsOf(const NamedBody& body, std::uint16_t self, const std::vector<Body>& bodies) {
  std::vector<SeparationFrom> separations;
  for (const auto& [name, separation_m] : body.separations_m) {
    const std::uint16_t other = name == SELF_NAME ? self : bodyNamed(name, bodies);
    separations.push_back({other, separation_m});
  }
  return separations;
}

}  // namespace

void requireMoved(const Positions& from, const Eigen::Isometry3d& motion, const Positions& to, const char* name) {
  for (std::size_t v = 0; v < from.size(); ++v) {
    const double off_m = (motion * from[v] - to[v]).norm();
    if (!(off_m > tolerance::RIGID_PATH_M) || !std::isfinite(off_m)) continue;
    throw py::value_error(std::string(name) + "[" + std::to_string(v) + "] is not where the poses take it");
  }
}

std::shared_ptr<const std::vector<double>> radiiOf(py::handle radii, const std::string& name) {
  const Doubles array = doublesOf(radii, name, {ANY});
  for (py::ssize_t i = 0; i < array.size(); ++i) {
    if (array.at(i) >= 0 && std::isfinite(array.at(i))) continue;
    throw py::value_error(name + "[" + std::to_string(i) + "] is " + std::to_string(array.at(i)) +
                          "; expected a finite number, 0 or more");
  }
  return share(std::vector<double>(array.data(), array.data() + array.size()));
}

std::vector<Body> bodiesOf(py::handle value) {
  std::vector<const NamedBody*> given;
  py::object sequence;  // holds them
  if (py::isinstance<NamedBody>(value)) {
    given.push_back(value.cast<const NamedBody*>());
  } else {
    if (!py::isinstance<py::sequence>(value) || py::isinstance<py::str>(value) || py::isinstance<py::array>(value)) {
      throw py::type_error("expected a dccd.Body or a list of them, as dccd.Body(t0, t1, triangles)");
    }
    sequence = py::tuple(py::reinterpret_borrow<py::object>(value));
    for (const py::handle item : sequence) {
      if (!py::isinstance<NamedBody>(item)) {
        throw py::type_error("bodies[" + std::to_string(given.size()) + "] is no dccd.Body");
      }
      given.push_back(item.cast<const NamedBody*>());
    }
  }
  // It would be answered: nothing touches.
  if (given.empty()) throw py::value_error("there is no body");
  std::vector<Body> bodies;
  for (const NamedBody* body : given) {
    bodies.push_back(body->body);
    if (bodies.back().name.empty()) bodies.back().name = "body_" + std::to_string(bodies.size() - 1);
  }
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (bodies[b].name == MAP_NAME || bodies[b].name == SELF_NAME) {
      throw py::value_error("bodies[" + std::to_string(b) + "]: where pairs are named '" + bodies[b].name +
                            "' is the map, or the body itself; give it another name");
    }
    if (bodyNamed(bodies[b].name, bodies) != b) {
      throw py::value_error("bodies[" + std::to_string(b) + "]: another body is called '" + bodies[b].name + "', too");
    }
    bodies[b].separations = separationsOf(*given[b], static_cast<std::uint16_t>(b), bodies);
  }
  return bodies;
}

std::uint16_t bodyNamed(const std::string& name, const std::vector<Body>& bodies) {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (bodies[b].name == name) return static_cast<std::uint16_t>(b);
  }
  if (name == MAP_NAME) return OBSTACLE_BODY;
  throw py::value_error("no body is called '" + name + "'");
}

std::uint16_t bodyOf(py::handle name_or_number, const std::vector<Body>& bodies) {
  if (py::isinstance<py::str>(name_or_number)) return bodyNamed(name_or_number.cast<std::string>(), bodies);
  const double number = numberOf(name_or_number, "a body's number");
  if (number == OBSTACLE_BODY) return OBSTACLE_BODY;
  if (!(number >= 0 && number < static_cast<double>(bodies.size()))) {
    throw py::value_error("there is no body " + py::cast<std::string>(py::str(name_or_number)) + "; there are " +
                          std::to_string(bodies.size()));
  }
  return static_cast<std::uint16_t>(number);
}

NamedBody named(const Body& body, const std::vector<Body>& bodies) {
  NamedBody out{body, {}};
  for (const SeparationFrom& from : body.separations) {
    const bool on_map = from.body == OBSTACLE_BODY;
    out.separations_m[on_map ? MAP_NAME : bodies.at(from.body).name] = from.separation_m;
  }
  out.body.separations.clear();
  return out;
}

void bindBody(py::module_& m) {
  using namespace py::literals;
  auto c = bindClass<NamedBody>(m, "Body", BODY_DOC);
  c.def(py::init(&makeBody), "t0"_a = py::none(), "t1"_a = py::none(), "triangles"_a = py::none(), py::kw_only(),
        "edges"_a = py::none(), "mesh"_a = py::none(), "name"_a = "", "rigid"_a = false, "static"_a = false,
        "self_collision"_a = true, "against_bodies"_a = true, "against_obstacle"_a = true, "shell"_a = false,
        "minimum_separation_m"_a = 0.0, "vertex_mask"_a = py::none(),
        "separations_m"_a = std::map<std::string, double>(), "reference"_a = py::none(), "radius_m"_a = py::none(),
        "pose_t0"_a = py::none(), "pose_t1"_a = py::none(),
        "__init__(self, t0=None, t1=None, triangles=None, *, edges=None, mesh=None, name='', rigid=False, "
        "static=False, self_collision=True, against_bodies=True, against_obstacle=True, shell=False, "
        "minimum_separation_m=0.0, vertex_mask=None, separations_m={}, reference=None, radius_m=None, "
        "pose_t0=None, pose_t1=None)\n--\n\nSee help(dccd.Body).");
  c.def("move_to", &moveTo, "positions"_a,
        "move_to(self, positions)\n--\n\nThe next step: t0 is what t1 was, and t1 is these positions, (n, 3) float64 "
        "[m].");
  c.def_property(
      "t0", [](const NamedBody& b) { return arrayOf(b.body.t0); }, &setT0,
      "(n, 3) float64 [m]: positions at the start. Reading gives a read-only view; assign to change them.");
  c.def_property(
      "t1", [](const NamedBody& b) { return arrayOf(b.body.t1); }, &setT1,
      "(n, 3) float64 [m]: positions at the end. Reading gives a read-only view; assign to change them.");
  c.def_property_readonly(
      "mesh", [](const NamedBody& b) { return std::const_pointer_cast<Topology>(b.body.topology); },
      "Mesh: its connectivity");
  bindWhatItIs(c);
  c.def("__repr__",
        [](const NamedBody& b) { return "<dccd.Body '" + b.body.name + "': " + textOf(*b.body.topology) + ">"; });
}

}  // namespace python
}  // namespace dccd
