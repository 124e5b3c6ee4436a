// sensor_msgs/PointCloud2: points, row by row, whose topology the configuration says.
#include <sensor_msgs/PointCloud2.h>

#include "input/message_type.h"
#include "input/object_views.h"

namespace dccd {
namespace {

const MeshTypeRegistration REGISTERED(
    meshType<sensor_msgs::PointCloud2, readCloud, viewOfCloud<sensor_msgs::PointCloud2>>("point_cloud2"));

}  // namespace
}  // namespace dccd
