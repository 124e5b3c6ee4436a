// What octomap_server makes of a camera's clouds, for scripts/benchmark cell_live: no Debian release packages it, so
// its loop stands here, on the same liboctomap, with its defaults (each finite point a ray; the tree pruned after each
// cloud). It publishes /octomap_binary alone, where octomap_server serializes all of its topics.
#include <octomap/OcTree.h>
#include <octomap_msgs/Octomap.h>
#include <ros/ros.h>
#include <sensor_msgs/point_cloud2_iterator.h>
#include <tf2_eigen/tf2_eigen.h>
#include <tf2_ros/transform_listener.h>

#include <Eigen/Geometry>
#include <cmath>
#include <sstream>
#include <string>

namespace {

class Server {
 public:
  Server() : tree_(ros::param::param("~resolution", 0.02)), max_range_m_(ros::param::param("~max_range", 2.0)) {
    maps_ = node_.advertise<octomap_msgs::Octomap>("/octomap_binary", 1, true);
    clouds_ = node_.subscribe<sensor_msgs::PointCloud2>("/camera/depth/color/points", 5,
                                                        [this](const auto& cloud) { take(*cloud); });
  }

 private:
  ros::NodeHandle node_;
  tf2_ros::Buffer buffer_;
  tf2_ros::TransformListener listener_{buffer_};
  octomap::OcTree tree_;
  double max_range_m_;
  octomap::KeyRay ray_;
  ros::Publisher maps_;
  ros::Subscriber clouds_;

  void take(const sensor_msgs::PointCloud2& cloud) try {
    const Eigen::Affine3f pose = tf2::transformToEigen(buffer_.lookupTransform("world", cloud.header.frame_id,
                                                                               cloud.header.stamp, ros::Duration(0.1)))
                                     .cast<float>();
    const octomap::point3d origin(pose.translation().x(), pose.translation().y(), pose.translation().z());
    octomap::KeySet free, occupied;
    octomap::OcTreeKey key;
    for (sensor_msgs::PointCloud2ConstIterator<float> it(cloud, "x"); it != it.end(); ++it) {
      if (!std::isfinite(it[0]) || !std::isfinite(it[1]) || !std::isfinite(it[2])) continue;
      const Eigen::Vector3f p = pose * Eigen::Vector3f(it[0], it[1], it[2]);
      octomap::point3d end(p.x(), p.y(), p.z());
      const bool is_near = (end - origin).norm() <= max_range_m_;
      if (!is_near) end = origin + (end - origin).normalized() * static_cast<float>(max_range_m_);
      if (tree_.computeRayKeys(origin, end, ray_)) free.insert(ray_.begin(), ray_.end());
      if (tree_.coordToKeyChecked(end, key)) (is_near ? occupied : free).insert(key);
    }
    for (const octomap::OcTreeKey& one : free) {
      if (occupied.find(one) == occupied.end()) tree_.updateNode(one, false);
    }
    for (const octomap::OcTreeKey& one : occupied) tree_.updateNode(one, true);
    tree_.prune();
    std::ostringstream stream;
    tree_.writeBinaryData(stream);
    const std::string bytes = stream.str();
    octomap_msgs::Octomap map;
    map.header.stamp = cloud.header.stamp;
    map.header.frame_id = "world";
    map.binary = true;
    map.id = tree_.getTreeType();
    map.resolution = tree_.getResolution();
    map.data.assign(bytes.begin(), bytes.end());
    maps_.publish(map);
  } catch (const tf2::TransformException& error) {
    ROS_WARN_STREAM_THROTTLE(1, error.what());
  }
};

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "octomap_server");
  Server server;
  ros::spin();
}
