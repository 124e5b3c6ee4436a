// visualization_msgs/Marker and MarkerArray: a triangle soup, three points a face; ropes, as lines or points.
#include <visualization_msgs/MarkerArray.h>

#include "input/message_type.h"
#include "input/object_views.h"

namespace dccd {
namespace {

using Markers = std::vector<MarkerView>;

using visualization_msgs::Marker;
static_assert(MARKER_TRIANGLE_LIST == Marker::TRIANGLE_LIST && MARKER_LINE_STRIP == Marker::LINE_STRIP &&
              MARKER_LINE_LIST == Marker::LINE_LIST && MARKER_SPHERE_LIST == Marker::SPHERE_LIST &&
              MARKER_POINTS == Marker::POINTS && MARKER_ADD == Marker::ADD && MARKER_DELETE == Marker::DELETE);

MarkerView readMarker(WireReader& wire) {
  MarkerView marker;
  marker.header = readHeader(wire);
  marker.ns = wire.readString("ns");
  marker.id = wire.read<std::int32_t>("id");
  marker.type = wire.read<std::int32_t>("type");
  marker.action = wire.read<std::int32_t>("action");
  for (double& value : marker.pose) value = wire.read<double>("pose");
  for (double& value : marker.scale) value = wire.read<double>("scale");
  wire.skip(4 * 4, "color");
  const auto seconds = wire.read<std::int32_t>("lifetime"), nanoseconds = wire.read<std::int32_t>("lifetime");
  marker.lifetime_ns = StampNs{seconds} * 1'000'000'000 + nanoseconds;
  wire.skip(1, "frame_locked");
  marker.points = wire.readArray<PointOnWire>("points");
  wire.readArray<std::array<float, 4>>("colors");
  wire.readString("text");
  wire.readString("mesh_resource");
  wire.skip(1, "mesh_use_embedded_materials");
  return marker;
}

std::size_t readCountOfMarkers(WireReader& wire) {
  // The smallest marker on the wire: all strings and arrays empty.
  constexpr std::size_t MIN_MARKER_BYTES = 16 + 4 + 12 + 56 + 24 + 25 + 4 + 4 + 4 + 4 + 1;
  return wire.readCount("markers", MIN_MARKER_BYTES);
}

MarkerView viewOfMarker(const visualization_msgs::Marker& message) {
  MarkerView marker;
  marker.header = viewOfHeader(message.header);
  marker.ns = message.ns;
  marker.id = message.id;
  marker.type = message.type;
  marker.action = message.action;
  const auto& p = message.pose.position;
  const auto& q = message.pose.orientation;
  marker.pose = {p.x, p.y, p.z, q.x, q.y, q.z, q.w};
  marker.scale = {message.scale.x, message.scale.y, message.scale.z};
  marker.lifetime_ns = message.lifetime.toNSec();
  marker.points = spanOf<PointOnWire>(message.points);
  return marker;
}

Markers alone(MarkerView marker) {
  marker.is_message = true;
  return {marker};
}

Markers readOne(WireReader& wire, const std::string&) { return alone(readMarker(wire)); }

Markers viewOfOne(const visualization_msgs::Marker& message, const std::string&) {
  return alone(viewOfMarker(message));
}

Markers readArray(WireReader& wire, const std::string&) {
  const std::size_t count = readCountOfMarkers(wire);
  Markers markers;
  markers.reserve(count);
  for (std::size_t i = 0; i < count; ++i) markers.push_back(readMarker(wire));
  return markers;
}

Markers viewOfArray(const visualization_msgs::MarkerArray& message, const std::string&) {
  Markers markers;
  markers.reserve(message.markers.size());
  for (const auto& marker : message.markers) markers.push_back(viewOfMarker(marker));
  return markers;
}

/// An array has no header of its own; that of its first marker stands in, but for those that only take others away.
HeaderView readFirstHeader(WireReader& wire) {
  for (std::size_t left = readCountOfMarkers(wire); left > 0; --left) {
    if (const MarkerView marker = readMarker(wire); marker.action == MARKER_ADD) return marker.header;
  }
  return {};
}

const MeshTypeRegistration ONE(meshType<visualization_msgs::Marker, readOne, viewOfOne>("marker"));
const MeshTypeRegistration ARRAY(
    meshType<visualization_msgs::MarkerArray, readArray, viewOfArray, readFirstHeader>("marker_array"));

}  // namespace
}  // namespace dccd
