// pcl_msgs/PolygonMesh: a cloud of vertices, and polygons by index.
#include <pcl_msgs/PolygonMesh.h>

#include "input/message_type.h"
#include "input/object_views.h"

namespace dccd {
namespace {

/// Where the mesh's own header says nothing, its cloud's counts.
HeaderView eitherOf(HeaderView own, const HeaderView& cloud) {
  if (own.stamp_ns == 0) own.stamp_ns = cloud.stamp_ns;
  if (own.frame_id.empty()) own.frame_id = cloud.frame_id;
  return own;
}

IndexedView read(WireReader& wire, const std::string& extra_field) {
  IndexedView mesh;
  const HeaderView own = readHeader(wire);
  mesh.cloud = readCloud(wire, extra_field);
  mesh.header = eitherOf(own, mesh.cloud->header);
  const std::size_t count = wire.readEntries("polygons", 4);
  mesh.polygons.reserve(count);
  for (std::size_t i = 0; i < count; ++i) mesh.polygons.push_back(wire.readArray<std::uint32_t>("polygons.vertices"));
  return mesh;
}

IndexedView view(const pcl_msgs::PolygonMesh& message, const std::string& extra_field) {
  IndexedView mesh;
  const HeaderView own = viewOfHeader(message.header);
  mesh.cloud = viewOfCloud(message.cloud, extra_field);
  mesh.header = eitherOf(own, mesh.cloud->header);
  mesh.polygons.reserve(message.polygons.size());
  for (const auto& polygon : message.polygons) mesh.polygons.push_back(spanOf<std::uint32_t>(polygon.vertices));
  return mesh;
}

const MeshTypeRegistration REGISTERED(meshType<pcl_msgs::PolygonMesh, read, view>("polygon_mesh"));

}  // namespace
}  // namespace dccd
