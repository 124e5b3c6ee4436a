// What the files of the Python module share: bodies as Python holds them, options by their names, and work that Ctrl-C
// can end.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "arrays.h"
#include "dccd/detect.h"
#include "dccd/stream.h"

namespace dccd {
namespace python {

/// Throws ValueError unless the motion takes each position to where it is, to RIGID_PATH_M. What is not finite is
/// unchecked.
void requireMoved(const Positions& from, const Eigen::Isometry3d& motion, const Positions& to, const char* name);

/// As in doc/interface.md.
constexpr const char* MAP_NAME = "octomap";
constexpr const char* SELF_NAME = "self";

/// A body whose separations still name the others.
struct NamedBody {
  Body body;
  std::map<std::string, double> separations_m;
};

using TopologyPtr = std::shared_ptr<const Topology>;
/// From just one of both.
TopologyPtr meshOf(std::size_t vertex_count, py::handle triangles, py::handle edges);
std::string textOf(const Topology& mesh);

struct Voxels {
  std::shared_ptr<const VoxelSurface> surface;
  Eigen::Isometry3d map_from_fixed = Eigen::Isometry3d::Identity();
  std::vector<Waypoint> way{};  // of a step that was recorded
};

/// One body or a sequence of them. Those without a name are called body_0 and so on; each name must be another one.
std::vector<Body> bodiesOf(py::handle bodies);
/// The number of the body of this name; OBSTACLE_BODY for MAP_NAME. Throws a ValueError where there is none.
std::uint16_t bodyNamed(const std::string& name, const std::vector<Body>& bodies);
/// By name or number.
std::uint16_t bodyOf(py::handle name_or_number, const std::vector<Body>& bodies);
NamedBody named(const Body& body, const std::vector<Body>& bodies);
/// The core looks at the sizes alone.
std::shared_ptr<const std::vector<double>> radiiOf(py::handle radii, const std::string& name);
ObstacleMap mapOf(py::handle voxels);  ///< None: there is none

/// Throws a TypeError that names an option which nobody knows, or whose value has another type.
void setOptions(const py::dict& values, const std::vector<Body>& bodies, Options& options);
/// All of them; `expected` names the bodies.
py::dict optionsOf(const Options& options, const std::vector<Body>& bodies);
/// False: there is no such option.
bool setOption(const std::string& name, py::handle value, const std::vector<Body>& bodies, Options& options);
[[noreturn]] void refuseOption(const std::string& name);
[[noreturn]] void refuseBodyOption(const std::string& name);
double numberOf(py::handle value, const std::string& name);

/// Runs `work` without the interpreter's lock. With a `cancel` a thread of its own does it, while this one sees to
/// signals: if a handler raises (Ctrl-C), cancel() is called, the work is waited for, and the exception goes on.
void runUnlocked(const std::function<void()>& work, const std::function<void()>& cancel = {});
/// Whether the step may take longer than a thread costs.
bool isLong(const std::vector<Body>& bodies, bool with_map);

/// An outcome for Python; the flags of its contacts are ready to be seen as a numpy array.
class Answer {
 public:
  explicit Answer(Outcome outcome);
  const Outcome& outcome() const { return outcome_; }

 private:
  Outcome outcome_;
};

void bindMesh(py::module_& m);
void bindBody(py::module_& m);
void bindVoxels(py::module_& m);
void bindOutcome(py::module_& m);
void bindQuestions(py::module_& m);
void bindStream(py::module_& m);

/// A class of the module, called as if dccd itself held it.
template <class T, class... More>
py::class_<T, More...> bindClass(py::module_& m, const char* name, const char* doc) {
  py::class_<T, More...> bound(m, name, doc);
  bound.attr("__module__") = "dccd";
  return bound;
}

}  // namespace python
}  // namespace dccd
