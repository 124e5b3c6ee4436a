// deformable_ccd/MeshStamped: vertices and triangles by index.
#include <deformable_ccd/MeshStamped.h>

#include "input/message_type.h"
#include "input/object_views.h"

namespace dccd {
namespace {

IndexedView read(WireReader& wire, const std::string&) {
  IndexedView mesh;
  mesh.header = readHeader(wire);
  mesh.points = wire.readArray<PointOnWire>("vertices");
  mesh.triangles = wire.readArray<TriangleOnWire>("triangles");
  return mesh;
}

IndexedView view(const deformable_ccd::MeshStamped& message, const std::string&) {
  IndexedView mesh;
  mesh.header = viewOfHeader(message.header);
  mesh.points = spanOf<PointOnWire>(message.vertices);
  mesh.triangles = spanOf<TriangleOnWire>(message.triangles);
  return mesh;
}

const MeshTypeRegistration REGISTERED(meshType<deformable_ccd::MeshStamped, read, view>("mesh_stamped"));

}  // namespace
}  // namespace dccd
