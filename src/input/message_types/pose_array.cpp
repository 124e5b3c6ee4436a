// geometry_msgs/PoseArray: a rope through the positions of its poses.
#include <geometry_msgs/PoseArray.h>

#include "input/message_type.h"
#include "input/object_views.h"

namespace dccd {
namespace {

using PoseOnWire = std::array<double, 7>;  // position x y z, quaternion x y z w

CloudView cloudOf(const HeaderView& header, WireSpan<PoseOnWire> poses) {
  CloudView cloud;
  cloud.header = header;
  cloud.height = 1;
  cloud.width = poses.size;
  cloud.point_step = sizeof(PoseOnWire);
  cloud.data = poses.data;
  cloud.is_rope = true;
  for (std::size_t axis = 0; axis < 3; ++axis) cloud.xyz[axis] = {axis * sizeof(double), true};
  return cloud;
}

CloudView read(WireReader& wire, const std::string&) {
  const HeaderView header = readHeader(wire);
  return cloudOf(header, wire.readArray<PoseOnWire>("poses"));
}

CloudView view(const geometry_msgs::PoseArray& message, const std::string&) {
  return cloudOf(viewOfHeader(message.header), spanOf<PoseOnWire>(message.poses));
}

const MeshTypeRegistration REGISTERED(meshType<geometry_msgs::PoseArray, read, view>("pose_array"));

}  // namespace
}  // namespace dccd
