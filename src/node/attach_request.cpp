#include "node/attach_request.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <stdexcept>

#include "config/body_config.h"
#include "input/short_text.h"
#include "robot/primitive_mesh.h"

namespace dccd {
namespace {

using Request = deformable_ccd::AttachObject::Request;
using Primitive = shape_msgs::SolidPrimitive;

constexpr double UNIT_TO = 0.005;  // of a quaternion's length, as of tf's

/// Of one request: each error begins with the object's name.
class AttachReader {
 public:
  AttachReader(const Request& request, const MonitorConfig& config) : request_(request), config_(config) {}

  AttachedObject read() const {
    AttachedObject object;
    checkName();
    object.name = request_.name;
    findLink(object);
    object.padding_m = padding();
    MeshResource mesh = surface();
    place(mesh);
    object.mesh = std::make_shared<const MeshResource>(std::move(mesh));
    return object;
  }

 private:
  const Request& request_;
  const MonitorConfig& config_;

  [[noreturn]] void fail(const std::string& what) const {
    throw ParameterError(shortText("object '" + shortText(request_.name, MAX_NAME) + "': " + what));
  }
  template <class Value>
  [[noreturn]] void fail(const std::string& field, const Value& value, const std::string& what) const {
    std::ostringstream text;
    text << field << " is " << value << "; " << what;
    fail(text.str());
  }

  void checkName() const {
    if (settingOf(config_.effects, Effect::RIGID_BODIES) == EffectSetting::OFF) {
      fail("effects/rigid_bodies is off, so that nothing can be attached; remove that");
    }
    if (const std::string problem = frameNameProblem(request_.name); !problem.empty()) {
      fail("name is no name: " + problem + "; give it one of its own");
    }
    const auto& links = config_.robot.links;
    bool taken = request_.name == "octomap" || request_.name == "self" ||
                 std::find(links.begin(), links.end(), request_.name) != links.end();
    for (const BodyConfig& body : config_.bodies) taken = taken || body.body.name == request_.name;
    if (taken) fail("name is that of a body or link; give it another one");
  }

  void findLink(AttachedObject& object) const {
    object.link = object.frame = request_.link;
    std::vector<std::string> known = config_.robot.links;
    bool found = std::find(known.begin(), known.end(), request_.link) != known.end();
    for (const BodyConfig& body : config_.bodies) {
      if (!body.isRigid() || !body.body.link.empty()) continue;
      known.push_back(body.body.name);
      if (found || body.body.name != request_.link) continue;
      found = true;
      object.frame = body.tf_frame;
    }
    if (!found) {
      fail("link is '" + shortText(request_.link, MAX_NAME) + "', which is no link of a robot and no rigid body; " +
           (known.empty() ? "there are none: name a robot by the parameter robot"
                          : "nearest is '" + nearestName(shortText(request_.link, MAX_NAME), known) + "'"));
    }
    addExpected("link", request_.link, object);
    for (const std::string& name : request_.touches) addExpected("touches", name, object);
    std::sort(object.expected.begin(), object.expected.end());
    object.expected.erase(std::unique(object.expected.begin(), object.expected.end()), object.expected.end());
  }

  void addExpected(const std::string& field, const std::string& name, AttachedObject& object) const {
    const auto bodies = bodiesNamed(name, config_);
    if (!bodies) fail(field + " names '" + shortText(name, MAX_NAME) + "', which is no link, group or body");
    object.expected.insert(object.expected.end(), bodies->begin(), bodies->end());
  }

  double padding() const {
    const double asked_m = request_.padding_m;
    if (!std::isfinite(asked_m) || asked_m < 0 || asked_m > LARGE) {
      fail("padding_m", asked_m, "it must be 0 or more, in metres");
    }
    if (settingOf(config_.effects, Effect::MINIMUM_SEPARATION) == EffectSetting::OFF) return 0;
    const double usual_m = std::max(config_.robot_asked.paddingOf(request_.link), config_.minimum_separation_m);
    return asked_m > 0 ? asked_m : usual_m;
  }

  MeshResource surface() const {
    const bool file = !request_.mesh.empty();
    const bool triangles = !request_.triangles.vertices.empty() || !request_.triangles.triangles.empty();
    const bool primitive = request_.primitive.type != 0;
    if (file + triangles + primitive != 1) {
      fail(file + triangles + primitive == 0 ? "it has no surface; give one of mesh, triangles and primitive"
                                             : "it has several surfaces; give one of mesh, triangles and primitive");
    }
    if (primitive) return primitiveMesh();
    const Vec3 scale(request_.scale.x, request_.scale.y, request_.scale.z);
    if (!scale.allFinite() || (scale.array() == 0).any()) {
      fail("scale", scale.transpose(), "it must be finite and not 0 along each axis; write 1, 1, 1");
    }
    MeshResource mesh = file ? meshFile() : meshOf(request_.triangles);
    if (mesh.topology->faces().size() > MOST_ATTACHED_TRIANGLES) {
      fail("it has " + std::to_string(mesh.topology->faces().size()) + " triangles; simplify it to " +
           std::to_string(MOST_ATTACHED_TRIANGLES));
    }
    for (Vec3& p : mesh.positions) p = scale.cwiseProduct(p);
    return mesh;
  }

  MeshResource meshFile() const {
    try {
      std::error_code unknown;  // the reader says what is wrong with such a file
      const std::uintmax_t bytes = std::filesystem::file_size(pathOf(request_.mesh), unknown);
      if (!unknown && bytes > MOST_ATTACHED_BYTES) {
        fail("mesh " + request_.mesh + " has " + std::to_string(bytes >> 20) + " MiB; simplify it to " +
             std::to_string(MOST_ATTACHED_BYTES >> 20));
      }
      return loadMeshResource(request_.mesh, 1);
    } catch (const std::invalid_argument& error) {
      fail(std::string("mesh ") + error.what());
    }
  }

  MeshResource meshOf(const Request::_triangles_type& message) const {
    MeshResource mesh;
    for (const auto& p : message.vertices) mesh.positions.emplace_back(p.x, p.y, p.z);
    std::vector<Face> faces;
    for (const auto& one : message.triangles) {
      for (const std::uint32_t corner : one.vertex_indices) {
        if (corner < mesh.positions.size()) continue;
        fail("triangles names vertex " + std::to_string(corner) + " of " + std::to_string(mesh.positions.size()));
      }
      faces.push_back({one.vertex_indices[0], one.vertex_indices[1], one.vertex_indices[2]});
    }
    try {
      mesh.topology = share(Topology::fromTriangles(mesh.positions.size(), faces));
    } catch (const TopologyError& error) {
      fail(std::string("triangles: ") + error.what());
    }
    if (!mesh.topology->hasFaces()) fail("triangles has no triangle");
    return mesh;
  }

  MeshResource primitiveMesh() const {
    const auto& sizes = request_.primitive.dimensions;
    const auto need = [&](std::size_t count, const std::string& what) {
      if (sizes.size() != count) fail("primitive/dimensions has " + std::to_string(sizes.size()) + " numbers; " + what);
      for (const double size : sizes) {
        if (!std::isfinite(size) || size <= 0 || size > LARGE) fail("a number of primitive/dimensions", size, what);
      }
    };
    const double tolerance_m = config_.monitor.detector.rigid_tolerance_m;
    PrimitiveMesh shape;
    switch (request_.primitive.type) {
      case Primitive::BOX:
        need(3, "write the sides along x, y and z, above 0");
        shape = boxMesh({sizes[0], sizes[1], sizes[2]});
        break;
      case Primitive::CYLINDER:
        need(2, "write height and radius, above 0");
        shape = cylinderMesh(sizes[Primitive::CYLINDER_RADIUS], sizes[Primitive::CYLINDER_HEIGHT], tolerance_m);
        break;
      case Primitive::SPHERE:
        need(1, "write the radius, above 0");
        shape = sphereMesh(sizes[0], tolerance_m);
        break;
      default:
        fail("primitive/type", static_cast<int>(request_.primitive.type), "known are BOX, SPHERE and CYLINDER");
    }
    MeshResource mesh;
    mesh.topology = share(Topology::fromTriangles(shape.positions.size(), shape.faces));
    mesh.positions = std::move(shape.positions);
    return mesh;
  }

  void place(MeshResource& mesh) const {
    const auto& at = request_.pose.position;
    const auto& turn = request_.pose.orientation;
    const Eigen::Quaterniond q(turn.w, turn.x, turn.y, turn.z);
    if (!(std::abs(q.norm() - 1) <= UNIT_TO)) {
      fail("the length of pose/orientation", q.norm(), "it must be 1; without a turn write w: 1");
    }
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = q.normalized().toRotationMatrix();
    pose.translation() = Vec3(at.x, at.y, at.z);
    if (!pose.matrix().allFinite()) fail("pose/position", pose.translation().transpose(), "it must be finite");
    for (Vec3& p : mesh.positions) {
      p = pose * p;
      if (!p.allFinite()) fail("a vertex of it is not finite");
    }
  }
};

}  // namespace

AttachedObject readAttach(const Request& request, const MonitorConfig& config) {
  return AttachReader(request, config).read();
}

}  // namespace dccd
