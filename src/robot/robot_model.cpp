#include "robot/robot_model.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "dccd/body.h"
#include "input/short_text.h"
#include "robot/primitive_mesh.h"
#include "robot/srdf_text.h"
#include "robot/urdf_text.h"

namespace dccd {
namespace {

// More than any robot has; each pair of them is listed where links do not meet.
constexpr std::size_t MOST_PARTS = 2000;
// No link of a robot that holds a cloth is so large, but one whose mesh is in millimetres is.
constexpr double LARGE_LINK_M = 5;

std::string shown(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

Vec3 vectorOf(const urdf::Vector3& v) { return {v.x, v.y, v.z}; }

Eigen::Isometry3d poseOf(const urdf::Pose& pose) {
  Eigen::Isometry3d transform = Eigen::Isometry3d::Identity();
  const urdf::Rotation& q = pose.rotation;
  transform.linear() = Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized().toRotationMatrix();
  transform.translation() = vectorOf(pose.position);
  return transform;
}

/// Throws std::invalid_argument unless the size is finite and above 0.
double positive(double size_m, const std::string& what) {
  if (std::isfinite(size_m) && size_m > 0) return size_m;
  throw std::invalid_argument(what + " is " + shown(size_m) + " m; it must be above 0");
}

/// Some write a sphere of radius 0 for a link that has no surface.
bool isPoint(const urdf::Collision& collision) {
  const auto* sphere = dynamic_cast<const urdf::Sphere*>(collision.geometry.get());
  return sphere && sphere->radius == 0;
}

class RobotMaker {
 public:
  RobotMaker(const RobotConfig& config, double tolerance_m) : config_(config), tolerance_m_(tolerance_m) {}

  Robot make(const RobotText& description, const RobotText& semantic) {
    robot_.text = description.text + '\n' + semantic.text;
    robot_.description = description.text;
    robot_.semantic_known = semantic.name.empty();
    UrdfText urdf;
    try {
      urdf = parseUrdf(given(description), config_.visuals);
    } catch (const RobotTextError& error) {
      miss("nothing of the robot is watched: " + description.name + " " + error.what());
      return std::move(robot_);
    }
    robot_.known = true;
    for (const auto& link : urdf.model->links_) robot_.links.push_back(link.first);
    if (!semantic.name.empty()) readSemantic(semantic, *urdf.model);
    findLeftOut();
    for (const auto& [link, shape] : urdf.unread) {
      if (!isLeftOut(link)) miss("not watched: " + shape);
    }
    for (const auto& link : urdf.model->links_) {
      if (!isLeftOut(link.first)) addLink(*link.second, urdf.refused[link.first], urdf.collisions[link.first]);
    }
    hintAtSurfaces(urdf);
    return std::move(robot_);
  }

 private:
  const RobotConfig& config_;
  const double tolerance_m_;
  Robot robot_;
  std::vector<std::string> bare_;  // links without collision elements

  static const std::string& given(const RobotText& text) {
    if (!text.problem.empty()) throw RobotTextError(text.problem);
    return text.text;
  }

  void miss(const std::string& sentence) { robot_.missing.push_back(shortText(sentence)); }
  void hint(const std::string& sentence) { robot_.hints.push_back(shortText(sentence)); }

  void readSemantic(const RobotText& semantic, const urdf::ModelInterface& model) {
    try {
      SrdfText srdf = parseSrdf(given(semantic), model);
      robot_.groups = std::move(srdf.groups);
      robot_.never_meet = std::move(srdf.never_meet);
      for (const std::string& sentence : srdf.hints) hint(semantic.name + ": " + sentence);
      robot_.semantic_known = true;
    } catch (const RobotTextError& error) {
      miss("no group of the robot is known: " + semantic.name + " " + error.what());
    }
  }

  void findLeftOut() {
    const std::string prefix = "group ";
    for (const std::string& name : config_.leave_out) {
      const auto group = name.compare(0, prefix.size(), prefix) == 0 ? robot_.groups.find(name.substr(prefix.size()))
                                                                     : robot_.groups.end();
      const std::vector<std::string> links =
          group == robot_.groups.end() ? std::vector<std::string>{name} : group->second;
      for (const std::string& link : robot_.links) {
        const bool named = std::find(links.begin(), links.end(), link) != links.end();
        if (named && !isLeftOut(link)) robot_.left_out.push_back(link);
      }
    }
  }

  bool isLeftOut(const std::string& link) const {
    return std::find(robot_.left_out.begin(), robot_.left_out.end(), link) != robot_.left_out.end();
  }

  /// declared: how many collision elements the description has of it.
  void addLink(const urdf::Link& link, const std::vector<std::string>& refused, std::size_t declared) {
    const std::size_t missing = robot_.missing.size();
    std::size_t accounted = 0;
    for (const std::string& problem : refused) miss("link '" + link.name + "' is not watched: " + problem);
    if (link.collision_array.empty() && refused.empty()) bare_.push_back(link.name);
    for (std::size_t i = 0; i < link.collision_array.size(); ++i) {
      const std::string number = std::to_string(i + 1);
      const std::string what = "link '" + link.name + "'" + (i == 0 ? "" : ", collision element " + number);
      if (robot_.parts.size() >= MOST_PARTS) {
        return miss(what + " is not watched: a robot may have " + std::to_string(MOST_PARTS) + " collision elements");
      }
      if (isPoint(*link.collision_array[i])) {
        robot_.excluded.push_back(what + ", a sphere of radius 0");
        ++accounted;
        continue;
      }
      try {
        const double scale = config_.scaleOf(link.name);
        MeshResource mesh = meshOf(*link.collision_array[i], scale, what);
        if (scale < 1) robot_.excluded.push_back(what + " but for a scale of " + shown(scale));
        robot_.parts.push_back(
            {link.name, i == 0 ? link.name : link.name + "/" + number, std::make_shared<const MeshResource>(mesh)});
        ++accounted;
      } catch (const std::exception& error) {  // also urdfdom's, of a geometry that it did not read
        miss(what + " is not watched: " + error.what());
      }
    }
    if (accounted < declared && robot_.missing.size() == missing) {
      miss("link '" + link.name + "' is not watched: " + std::to_string(accounted) + " of its " +
           std::to_string(declared) + " collision elements were read");
    }
  }

  /// In the link's frame. Throws std::exception with what is wrong.
  MeshResource meshOf(const urdf::Collision& collision, double scale, const std::string& what) {
    MeshResource mesh = shapeOf(*collision.geometry, tolerance_m_ / scale, what);
    const Eigen::Isometry3d origin = poseOf(collision.origin);
    Eigen::AlignedBox3d bounds, own;
    for (const Vec3& p : mesh.positions) own.extend(p);
    const Vec3 shift = (1 - scale) * own.center();  // about its middle: what is larger is where it was
    for (Vec3& p : mesh.positions) {
      p = origin * (shift + scale * p);
      if (!p.allFinite()) throw std::invalid_argument("a coordinate is not finite");
      bounds.extend(p);
    }
    if (bounds.diagonal().norm() > LARGE_LINK_M) {
      hint(what + " is " + shown(bounds.diagonal().norm()) +
           " m across: if its mesh is in millimetres, write scale=\"0.001 0.001 0.001\" beside its filename");
      robot_.doubts.push_back(robot_.hints.back());
    }
    return mesh;
  }

  MeshResource shapeOf(const urdf::Geometry& geometry, double tolerance_m, const std::string& what) {
    if (const auto* mesh = dynamic_cast<const urdf::Mesh*>(&geometry)) return meshFile(*mesh, what);
    PrimitiveMesh shape;
    if (const auto* box = dynamic_cast<const urdf::Box*>(&geometry)) {
      for (const double side : {box->dim.x, box->dim.y, box->dim.z}) positive(side, "a side of its box");
      shape = boxMesh(vectorOf(box->dim));
    } else if (const auto* cylinder = dynamic_cast<const urdf::Cylinder*>(&geometry)) {
      shape = cylinderMesh(positive(cylinder->radius, "the radius of its cylinder"),
                           positive(cylinder->length, "the length of its cylinder"), tolerance_m);
    } else if (const auto* sphere = dynamic_cast<const urdf::Sphere*>(&geometry)) {
      shape = sphereMesh(positive(sphere->radius, "the radius of its sphere"), tolerance_m);
    } else {
      throw std::invalid_argument("its geometry is no box, cylinder, sphere or mesh");
    }
    if (shape.outside_m > 1.001 * tolerance_m) {
      hint(what + ": the mesh of its round primitive reaches up to " + shown(shape.outside_m) +
           " m out of it; for less it would take too many triangles");
    }
    MeshResource mesh;
    mesh.topology = share(Topology::fromTriangles(shape.positions.size(), shape.faces));
    mesh.positions = std::move(shape.positions);
    return mesh;
  }

  /// Which way round its faces are does not matter to any test, but to who looks at them: a mirrored one is turned.
  MeshResource meshFile(const urdf::Mesh& file, const std::string& what) {
    const Vec3 scale = vectorOf(file.scale);
    if (!scale.allFinite() || (scale.array() == 0).any()) {
      throw std::invalid_argument("the scale of its mesh " + file.filename + " is 0 or not finite along an axis");
    }
    MeshResource mesh = loadMeshResource(file.filename, 1);
    for (const std::string& sentence : mesh.hints) hint(what + ": " + file.filename + ": " + sentence);
    for (Vec3& p : mesh.positions) p = scale.cwiseProduct(p);
    if (scale.prod() > 0) return mesh;
    std::vector<Face> faces = mesh.topology->faces();
    for (Face& face : faces) std::swap(face[1], face[2]);
    mesh.topology = share(Topology::fromTriangles(mesh.positions.size(), faces));
    return mesh;
  }

  static std::string quoted(const std::string& text, const std::string& name) {
    return text + (text.empty() ? "'" : ", '") + name + "'";
  }

  void hintAtSurfaces(const UrdfText& urdf) {
    std::string visual_only, bare;
    for (const std::string& link : bare_) {
      std::string& list = urdf.visual_only.count(link) > 0 ? visual_only : bare;
      list = quoted(list, link);
    }
    if (!visual_only.empty()) {
      const std::string why = "they have a visual but no collision element (robot/visuals: true takes the visual)";
      hint("not watched, for " + why + ": links " + visual_only);
      robot_.excluded.push_back("links " + visual_only + ": " + why);
    }
    if (!bare.empty()) hint("without geometry are links " + bare);
    if (robot_.parts.empty() && robot_.missing.empty()) miss("the robot has no link with a collision element");
  }
};

}  // namespace

Robot makeRobot(const RobotText& description, const RobotText& semantic, const RobotConfig& config,
                double tolerance_m) {
  return RobotMaker(config, tolerance_m).make(description, semantic);
}

}  // namespace dccd
