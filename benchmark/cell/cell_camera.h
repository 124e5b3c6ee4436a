// Of the cell of cell_publisher: what its depth camera sees, rendered before the first message, and the messages.
#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/PointCloud2.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "cell/cell_world.h"

namespace dccd {
namespace benchmarks {

constexpr int WIDTH = 640, HEIGHT = 480;
constexpr double FOCAL = 390, CENTER_X = 0.5 * (WIDTH - 1), CENTER_Y = 0.5 * (HEIGHT - 1);
const Vec3 EYE(0.9, 0, 1.5), LOOKS_AT(0.35, 0, 0.2);
const Eigen::AlignedBox2d TABLE(Eigen::Vector2d(-0.5, -0.9), Eigen::Vector2d(1.3, 0.9));  // at z = 0
constexpr double FLOOR_Z = -0.75;

/// World_from_camera, of its optical frame: z forward, x to the right.
inline Pose cameraPose() {
  Pose pose = Pose::Identity();
  const Vec3 forward = (LOOKS_AT - EYE).normalized(), right = forward.cross(Vec3::UnitZ()).normalized();
  pose.linear() << right, forward.cross(right), forward;
  pose.translation() = EYE;
  return pose;
}

using Depth = std::vector<float>;            // [m] along the optical axis
using Picture = std::vector<std::uint16_t>;  // [mm], as a RealSense has it; 0: nothing was seen

class Renderer {
 public:
  explicit Renderer(const Settings& settings) : settings_(settings), background_(WIDTH * HEIGHT) {
    const Pose camera = cameraPose();
    for (int v = 0; v < HEIGHT; ++v) {
      for (int u = 0; u < WIDTH; ++u) {
        const Vec3 ray = camera.linear() * Vec3((u - CENTER_X) / FOCAL, (v - CENTER_Y) / FOCAL, 1);
        double z = -EYE.z() / ray.z();
        if (!(z > 0) || !TABLE.contains(Eigen::Vector2d((EYE + z * ray).head<2>()))) z = (FLOOR_Z - EYE.z()) / ray.z();
        background_[WIDTH * v + u] = static_cast<float>(z > 0 ? z : std::numeric_limits<double>::infinity());
      }
    }
    std::normal_distribution<float> normal;
    for (float& one : noise_) one = normal(random_);
  }

  void begin() { depth_ = background_; }
  void draw(const Pose& pose, const Positions& positions, const std::vector<Face>& faces) {
    const Pose camera_from_mesh = cameraPose().inverse() * pose;
    std::vector<Eigen::Vector3f> pixels;  // and the depth's inverse, which is linear in them
    for (const Vec3& p : positions) {
      const Vec3 q = camera_from_mesh * p;
      pixels.emplace_back(FOCAL * q.x() / q.z() + CENTER_X, FOCAL * q.y() / q.z() + CENTER_Y, 1 / q.z());
    }
    for (const Face& face : faces) drawFace(pixels[face[0]], pixels[face[1]], pixels[face[2]]);
  }
  Picture end() {
    Picture picture(depth_.size());
    std::uniform_int_distribution<std::size_t> anywhere(0, noise_.size() - 1);
    std::uniform_real_distribution<float> share(0, 1);
    std::size_t next = anywhere(random_);
    for (std::size_t i = 0; i < depth_.size(); ++i, next = next + 1 < noise_.size() ? next + 1 : 0) {
      const float noisy = depth_[i] + static_cast<float>(settings_.noise_m) * noise_[next];
      if (noisy > 0 && noisy < 10) picture[i] = static_cast<std::uint16_t>(std::lround(1000 * noisy));
    }
    const auto some = [&](double of_all) {
      return static_cast<std::size_t>(of_all * static_cast<double>(depth_.size()));
    };
    std::uniform_int_distribution<std::size_t> pixel(0, depth_.size() - 1);
    for (std::size_t n = some(settings_.lost_share); n > 0; --n) picture[pixel(random_)] = 0;
    // Between what is in front at an edge and what is behind.
    std::vector<std::size_t> edges;
    for (std::size_t i = 1; i < depth_.size(); ++i) {
      if (std::abs(depth_[i] - depth_[i - 1]) > 0.05F && std::isfinite(depth_[i] + depth_[i - 1])) edges.push_back(i);
    }
    for (std::size_t n = edges.empty() ? 0 : some(settings_.flying_share); n > 0; --n) {
      const std::size_t i = edges[pixel(random_) % edges.size()];
      const float u = share(random_);
      picture[i] = static_cast<std::uint16_t>(1000 * (u * depth_[i] + (1 - u) * depth_[i - 1]));
    }
    return picture;
  }

 private:
  const Settings& settings_;
  Depth background_, depth_;
  std::mt19937 random_{1};
  std::vector<float> noise_ = std::vector<float>(1 << 20);

  void drawFace(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c) {
    const Eigen::Vector2f ab = (b - a).head<2>(), ac = (c - a).head<2>();
    const float area = ab.x() * ac.y() - ab.y() * ac.x();
    if (!(std::abs(area) > 1e-6F)) return;
    const Eigen::Vector3f lo = a.cwiseMin(b).cwiseMin(c), hi = a.cwiseMax(b).cwiseMax(c);
    for (int v = std::max(0, int(std::ceil(lo.y()))); v <= std::min(HEIGHT - 1, int(std::floor(hi.y()))); ++v) {
      for (int u = std::max(0, int(std::ceil(lo.x()))); u <= std::min(WIDTH - 1, int(std::floor(hi.x()))); ++u) {
        const float x = float(u) - a.x(), y = float(v) - a.y();
        const float s = (x * ac.y() - y * ac.x()) / area, t = (ab.x() * y - ab.y() * x) / area;
        if (s < 0 || t < 0 || s + t > 1) continue;
        const float z = 1 / (a.z() + s * (b.z() - a.z()) + t * (c.z() - a.z()));
        float& pixel = depth_[WIDTH * v + u];
        if (z > 0 && z < pixel) pixel = z;
      }
    }
  }
};

/// Pictures by number: those of the start, and of one period, which come again and again.
class Film {
 public:
  Film(const Settings& settings, const Arm& arm)
      : period_(static_cast<std::size_t>(std::lround(settings.camera_hz * PERIOD_S))) {
    // A period begins where a whole number of pictures has gone by.
    const auto first = static_cast<std::size_t>(std::ceil(MOVES_S * settings.camera_hz));
    Renderer renderer(settings);
    const std::vector<Face> faces = clothFaces();
    for (std::size_t i = 0; i < first + period_; ++i) {
      const double time_s = stampOf(settings, i);
      renderer.begin();
      const auto links = arm.linksAt(time_s);
      for (const RobotPart& part : arm.robot().parts) {
        renderer.draw(links.at(part.link), part.mesh->positions, part.mesh->topology->faces());
      }
      if (time_s >= SEEN_S) renderer.draw(Pose::Identity(), clothAt(links.at("tool0"), time_s), faces);
      pictures_.push_back(renderer.end());
    }
  }
  static double stampOf(const Settings& settings, std::size_t number) {
    return static_cast<double>(number) / settings.camera_hz + 0.007;
  }
  const Picture& at(std::size_t number) const {
    const std::size_t first = pictures_.size() - period_;
    return pictures_[number < first ? number : first + (number - first) % period_];
  }

 private:
  std::size_t period_;
  std::vector<Picture> pictures_;
};

constexpr const char* CAMERA_FRAME = "camera_depth_optical_frame";

inline sensor_msgs::PointCloud2 cloudOf(std::uint32_t rows, std::uint32_t cols, std::uint8_t datatype,
                                        std::uint32_t point_step) {
  sensor_msgs::PointCloud2 cloud;
  for (const char* name : {"x", "y", "z"}) {
    sensor_msgs::PointField& field = cloud.fields.emplace_back();
    field.name = name;
    field.datatype = datatype;
    field.count = 1;
    const std::uint32_t size = datatype == sensor_msgs::PointField::FLOAT64 ? 8 : 4;
    field.offset = size * static_cast<std::uint32_t>(cloud.fields.size() - 1);
  }
  cloud.height = rows;
  cloud.width = cols;
  cloud.point_step = point_step;
  cloud.row_step = cols * point_step;
  cloud.data.resize(rows * cloud.row_step);
  return cloud;
}

inline geometry_msgs::TransformStamped transformOf(const std::string& parent, const std::string& child,
                                                   const Pose& pose) {
  geometry_msgs::TransformStamped out;
  out.header.stamp = ros::Time::now();
  out.header.frame_id = parent;
  out.child_frame_id = child;
  out.transform.translation.x = pose.translation().x();
  out.transform.translation.y = pose.translation().y();
  out.transform.translation.z = pose.translation().z();
  const Eigen::Quaterniond q(pose.linear());
  out.transform.rotation.x = q.x();
  out.transform.rotation.y = q.y();
  out.transform.rotation.z = q.z();
  out.transform.rotation.w = q.w();
  return out;
}

class Camera {
 public:
  Camera(ros::NodeHandle& node, const Settings& settings, const Arm& arm)
      : settings_(settings),
        film_(settings, arm),
        cloud_(cloudOf(static_cast<std::uint32_t>(HEIGHT / settings.stride),
                       static_cast<std::uint32_t>(WIDTH / settings.stride), sensor_msgs::PointField::FLOAT32, 16)) {
    if (settings.clouds) clouds_ = node.advertise<sensor_msgs::PointCloud2>("/camera/depth/color/points", 2);
    if (settings.images) {
      images_ = node.advertise<sensor_msgs::Image>("/camera/depth/image_rect_raw", 2);
      infos_ = node.advertise<sensor_msgs::CameraInfo>("/camera/depth/camera_info", 2);
    }
    cloud_.header.frame_id = image_.header.frame_id = info_.header.frame_id = CAMERA_FRAME;
    image_.width = info_.width = WIDTH;
    image_.height = info_.height = HEIGHT;
    image_.encoding = "16UC1";
    image_.step = 2 * WIDTH;
    image_.data.resize(image_.step * HEIGHT);
    info_.distortion_model = "plumb_bob";
    info_.D.assign(5, 0);
    info_.K = {FOCAL, 0, CENTER_X, 0, FOCAL, CENTER_Y, 0, 0, 1};
    info_.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    info_.P = {FOCAL, 0, CENTER_X, 0, 0, FOCAL, CENTER_Y, 0, 0, 0, 1, 0};
  }

  void publish(std::size_t number, const ros::Time& stamp) {
    cloud_.header.stamp = image_.header.stamp = info_.header.stamp = stamp;
    const Picture& picture = film_.at(number);
    if (settings_.images) {
      std::copy_n(reinterpret_cast<const std::uint8_t*>(picture.data()), image_.data.size(), image_.data.data());
      infos_.publish(info_);
      images_.publish(image_);
    }
    if (!settings_.clouds) return;
    auto* out = reinterpret_cast<float*>(cloud_.data.data());
    const int stride = settings_.stride;
    for (int v = 0; v + stride <= HEIGHT; v += stride) {
      const auto y = static_cast<float>((v - CENTER_Y) / FOCAL);
      for (int u = 0; u + stride <= WIDTH; u += stride, out += 4) {
        const std::uint16_t depth = picture[WIDTH * v + u];
        const float z = depth == 0 ? std::numeric_limits<float>::quiet_NaN() : 0.001F * depth;
        out[0] = static_cast<float>((u - CENTER_X) / FOCAL) * z;
        out[1] = y * z;
        out[2] = z;
      }
    }
    clouds_.publish(cloud_);
  }

 private:
  const Settings& settings_;
  Film film_;
  ros::Publisher clouds_, images_, infos_;
  sensor_msgs::PointCloud2 cloud_;
  sensor_msgs::Image image_;
  sensor_msgs::CameraInfo info_;
};

}  // namespace benchmarks
}  // namespace dccd
