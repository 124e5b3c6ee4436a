// shape_msgs/Mesh: triangles by index and vertices, without a header.
#include <shape_msgs/Mesh.h>

#include "input/message_type.h"
#include "input/object_views.h"

namespace dccd {
namespace {

IndexedView read(WireReader& wire, const std::string&) {
  IndexedView mesh;
  mesh.triangles = wire.readArray<TriangleOnWire>("triangles");
  mesh.points = wire.readArray<PointOnWire>("vertices");
  return mesh;
}

IndexedView view(const shape_msgs::Mesh& message, const std::string&) {
  IndexedView mesh;
  mesh.triangles = spanOf<TriangleOnWire>(message.triangles);
  mesh.points = spanOf<PointOnWire>(message.vertices);
  return mesh;
}

const MeshTypeRegistration REGISTERED(meshType<shape_msgs::Mesh, read, view>("shape_mesh"));

}  // namespace
}  // namespace dccd
