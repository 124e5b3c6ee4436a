#include "input/typed_mesh.h"

#include <type_traits>

namespace dccd {

namespace {

HeaderView headerView(const std_msgs::Header& header) {
  if (header.stamp.nsec >= 1000000000u) {
    throw WireError("header.stamp has " + std::to_string(header.stamp.nsec) + " nanoseconds");
  }
  return {static_cast<StampNs>(header.stamp.toNSec()), header.frame_id};
}

/// A vector of plain elements as a span of their bytes.
template <typename Element, typename Vector>
WireSpan<Element> spanOf(const Vector& elements) {
  static_assert(sizeof(Element) == sizeof(typename Vector::value_type), "the element is laid out as on the wire");
  static_assert(std::is_standard_layout_v<typename Vector::value_type>);
  return {reinterpret_cast<const std::uint8_t*>(elements.data()), elements.size()};
}

using Point = std::array<double, 3>;
using Triangle = std::array<std::uint32_t, 3>;

}  // namespace

std::string datatypeOf(const TypedMesh& mesh) {
  return std::visit(
      [](const auto& message) {
        using Message = std::remove_const_t<std::remove_reference_t<decltype(*message)>>;
        return std::string(ros::message_traits::datatype<Message>());
      },
      mesh);
}

CloudView viewOf(const sensor_msgs::PointCloud2& cloud, const std::string& extra_field) {
  CloudView view;
  view.header = headerView(cloud.header);
  view.height = cloud.height;
  view.width = cloud.width;
  CloudFieldFinder finder(extra_field);
  for (const auto& field : cloud.fields) finder.add(field.name, field.offset, field.datatype, view);
  finder.finish(view);
  if (cloud.is_bigendian) throw WireError("is_bigendian is set; send little-endian clouds");
  view.point_step = cloud.point_step;
  view.row_step = cloud.row_step;
  view.data = cloud.data.data();
  checkStrides(view, cloud.data.size());
  return view;
}

IndexedView viewOf(const deformable_ccd::MeshStamped& mesh) {
  IndexedView view;
  view.header = headerView(mesh.header);
  view.points = spanOf<Point>(mesh.vertices);
  view.triangles = spanOf<Triangle>(mesh.triangles);
  return view;
}

IndexedView viewOf(const shape_msgs::Mesh& mesh) {
  IndexedView view;
  view.triangles = spanOf<Triangle>(mesh.triangles);
  view.points = spanOf<Point>(mesh.vertices);
  return view;
}

IndexedView viewOf(const pcl_msgs::PolygonMesh& mesh, const std::string& extra_field) {
  IndexedView view;
  view.header = headerView(mesh.header);
  view.cloud = viewOf(mesh.cloud, extra_field);
  fillHeader(view);
  view.polygons.reserve(mesh.polygons.size());
  for (const auto& polygon : mesh.polygons) view.polygons.push_back(spanOf<std::uint32_t>(polygon.vertices));
  return view;
}

MarkerView viewOf(const visualization_msgs::Marker& marker) {
  MarkerView view;
  view.header = headerView(marker.header);
  view.ns = marker.ns;
  view.id = marker.id;
  view.type = marker.type;
  view.action = marker.action;
  const auto& p = marker.pose.position;
  const auto& q = marker.pose.orientation;
  view.pose = {p.x, p.y, p.z, q.x, q.y, q.z, q.w};
  view.scale = {marker.scale.x, marker.scale.y, marker.scale.z};
  view.points = spanOf<Point>(marker.points);
  return view;
}

std::vector<MarkerView> viewOf(const visualization_msgs::MarkerArray& array) {
  std::vector<MarkerView> views;
  views.reserve(array.markers.size());
  for (const auto& marker : array.markers) views.push_back(viewOf(marker));
  return views;
}

}  // namespace dccd
