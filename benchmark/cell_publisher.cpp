// A cell as a first user has it, in one process beside the node: an arm whose joints come at 100 Hz, a cloth in its
// hand at 30 Hz, a depth camera above a table. What the camera sees is rendered before the first message. It listens to
// what the monitor says of it, and writes down what that cost.
#include <deformable_ccd/SpeedScale.h>
#include <deformable_ccd/State.h>
#include <deformable_ccd/StepStats.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_msgs/TFMessage.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <iterator>
#include <kdl_parser/kdl_parser.hpp>
#include <limits>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "robot/robot_model.h"

namespace dccd {
namespace benchmarks {
namespace {

using Pose = Eigen::Isometry3d;
using nlohmann::json;

struct Settings {
  std::string urdf, out, monitor;
  std::vector<std::string> processes;  // NAME=PID
  double camera_hz = 15, noise_m = 0.003, lost_share = 0.05, flying_share = 0.001, start_s = 5, seconds = 20;
  bool clouds = false, images = false;
  int stride = 1;
};

// --- what moves
// --------------------------------------------------------------------------------------------------------

// The cloth's rate is not a multiple of the camera's, so that each phase between the two comes. Frames come later than
// their stamps: a tracker takes a picture's time, a camera's driver less.
constexpr double JOINT_HZ = 100, CLOTH_HZ = 29.9, TRACKER_LAG_S = 0.03, DRIVER_LAG_S = 0.025;
// When the cloth comes, is seen, and the arm sets off; how long it takes to and fro.
constexpr double CLOTH_S = 2, SEEN_S = 2.2, MOVES_S = 2.5, PERIOD_S = 8;
constexpr int ROWS = 20, COLS = 30, JOINTS = 6;
constexpr double SPACING_M = 0.015;
const std::array<std::string, JOINTS> NAMES{"shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
                                            "wrist_1_joint",      "wrist_2_joint",       "wrist_3_joint"};

/// 0 to 1 and back, from rest to rest.
double wayAt(double time_s) { return 0.5 - 0.5 * std::cos(2 * M_PI * std::max(0.0, time_s - MOVES_S) / PERIOD_S); }

std::array<double, JOINTS> jointsAt(double time_s) {
  const double way = wayAt(time_s);
  // The hand points down, half a metre before the base.
  return {-0.7 + 1.4 * way, -1.57 + 0.15 * way, 1.17, -1.17 - 0.15 * way, -1.57, 0.6 * way};
}

class Arm {
 public:
  explicit Arm(const std::string& urdf) {
    if (!kdl_parser::treeFromString(urdf, tree_)) throw std::runtime_error("KDL cannot read the robot");
    robot_ = makeRobot({"urdf", urdf, ""}, {}, {}, 1e-3);
    if (!robot_.missing.empty()) throw std::runtime_error(robot_.missing.front());
  }
  const Robot& robot() const { return robot_; }

  std::map<std::string, Pose> linksAt(double time_s) const {
    const auto joints = jointsAt(time_s);
    std::map<std::string, Pose> links{{tree_.getRootSegment()->first, Pose::Identity()}};
    const std::function<void(const KDL::TreeElement&)> go = [&](const KDL::TreeElement& parent) {
      for (const auto& child : parent.children) {
        const KDL::Segment& segment = child->second.segment;
        const auto joint = std::find(NAMES.begin(), NAMES.end(), segment.getJoint().getName());
        const KDL::Frame frame =
            segment.pose(joint == NAMES.end() ? 0 : joints[static_cast<std::size_t>(joint - NAMES.begin())]);
        Pose pose = Pose::Identity();
        for (int row = 0; row < 3; ++row) {
          for (int col = 0; col < 3; ++col) pose.linear()(row, col) = frame.M(row, col);
          pose.translation()[row] = frame.p(row);
        }
        links[segment.getName()] = links.at(parent.segment.getName()) * pose;
        go(child->second);
      }
    };
    go(tree_.getRootSegment()->second);
    return links;
  }

 private:
  KDL::Tree tree_;
  Robot robot_;
};

/// It hangs from the flange, of which it is held 3 mm inside, swings and ripples.
Positions clothAt(const Pose& tool, double time_s) {
  const Vec3 along = Vec3(tool.linear()(0, 0), tool.linear()(1, 0), 0).normalized(),
             across = Vec3::UnitZ().cross(along);
  const double turn = 2 * M_PI * std::max(0.0, time_s - MOVES_S) / PERIOD_S, swing = 0.08 * std::sin(6 * turn);
  Positions cloth;
  for (int row = 0; row < ROWS; ++row) {
    for (int col = 0; col < COLS; ++col) {
      const double down = SPACING_M * row, aside = SPACING_M * (col - 0.5 * (COLS - 1));
      const double ripple = 0.02 * down * std::sin(25 * aside + 4 * turn);
      cloth.push_back(tool.translation() + Vec3(0, 0, 0.003 - down * std::cos(swing)) + aside * along +
                      (down * std::sin(swing) + ripple) * across);
    }
  }
  return cloth;
}

std::vector<Face> clothFaces() {
  std::vector<Face> faces;
  for (Index row = 0; row + 1 < ROWS; ++row) {
    for (Index col = 0; col + 1 < COLS; ++col) {
      const Index at = row * COLS + col;
      faces.push_back({at, at + 1, at + COLS});
      faces.push_back({at + 1, at + COLS + 1, at + COLS});
    }
  }
  return faces;
}

// --- what the camera sees
// ----------------------------------------------------------------------------------------------

constexpr int WIDTH = 640, HEIGHT = 480;
constexpr double FOCAL = 390, CENTER_X = 0.5 * (WIDTH - 1), CENTER_Y = 0.5 * (HEIGHT - 1);
const Vec3 EYE(0.9, 0, 1.5), LOOKS_AT(0.35, 0, 0.2);
const Eigen::AlignedBox2d TABLE(Eigen::Vector2d(-0.5, -0.9), Eigen::Vector2d(1.3, 0.9));  // at z = 0
constexpr double FLOOR_Z = -0.75;

/// World_from_camera, of its optical frame: z forward, x to the right.
Pose cameraPose() {
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

// --- messages
// ----------------------------------------------------------------------------------------------------------

constexpr const char* CAMERA_FRAME = "camera_depth_optical_frame";

sensor_msgs::PointCloud2 cloudOf(std::uint32_t rows, std::uint32_t cols, std::uint8_t datatype,
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

geometry_msgs::TransformStamped transformOf(const std::string& parent, const std::string& child, const Pose& pose) {
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

// --- what it costs
// -----------------------------------------------------------------------------------------------------

/// [s] of the processor that a process took so far.
double processorSeconds(const std::string& pid) {
  std::ifstream file("/proc/" + pid + "/stat");
  std::string text{std::istreambuf_iterator<char>(file), {}};
  std::istringstream rest(text.substr(text.rfind(')') + 2));
  std::vector<std::string> fields{std::istream_iterator<std::string>(rest), {}};
  if (fields.size() < 13) throw std::runtime_error("process " + pid + " has ended");
  return (std::stod(fields[11]) + std::stod(fields[12])) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

/// The same of all processes of the machine.
double machineSeconds() {
  std::ifstream file("/proc/stat");
  std::string cpu;
  double user = 0, nice = 0, system = 0, idle = 0, wait = 0, irq = 0, soft = 0;
  file >> cpu >> user >> nice >> system >> idle >> wait >> irq >> soft;
  return (user + nice + system + irq + soft) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

std::string withoutNumbers(const std::string& sentence) {
  std::string out;
  for (const char c : sentence) {
    const bool digit = std::isdigit(static_cast<unsigned char>(c)) != 0;
    if (!digit) out += c;
    if (digit && (out.empty() || out.back() != '#')) out += '#';
  }
  return out;
}

/// What the monitor says within the window, by the clock here: a state holds until the next one.
class Witness {
 public:
  Witness(ros::NodeHandle& node, const Settings& settings) : settings_(settings) {
    const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
    state_ = node.subscribe<deformable_ccd::State>(
        settings.monitor + "/state", 100, [this](const auto& m) { onState(*m); }, {}, hints);
    scale_ = node.subscribe<deformable_ccd::SpeedScale>(
        settings.monitor + "/speed_scale", 100, [this](const auto& m) { onScale(*m); }, {}, hints);
    stats_ = node.subscribe<deformable_ccd::StepStats>(
        settings.monitor + "/stats", 100, [this](const auto& m) { onStats(*m); }, {}, hints);
  }

  void begin() {
    const std::lock_guard<std::mutex> lock(mutex_);
    begun_s_ = state_since_s_ = scale_since_s_ = ros::WallTime::now().toSec();
    processor_ = seconds();
    is_open_ = true;
  }

  void end(json& out) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const double now_s = ros::WallTime::now().toSec(), window_s = now_s - begun_s_;
    passState(now_s);
    passScale(now_s);
    is_open_ = false;
    for (const auto& [name, used_s] : seconds()) out["share"][name] = (used_s - processor_.at(name)) / window_s;
    out["window_s"] = window_s;
    out["steps"] = answers_;
    out["proved"] = proved_;
    out["touching_expected"] = touching_expected_;
    out["touching_else"] = touching_else_;
    out["proved_share_of_time"] = proved_s_ / window_s;
    out["scale_above_0"] = moving_s_ / window_s;
    out["scale_said"] = scales_.size();
    out["scale"] = sorted(scales_);
    out["maps"] = map_stamps_.size();
    out["map_age_s"] = sorted(map_ages_);
    out["latency_ms"] = sorted(latencies_ms_);
    out["step_ms"] = sorted(steps_ms_);
    out["clearance_ms"] = sorted(clearances_ms_);
    out["own_voxels_ms"] = sorted(own_voxels_ms_);  // of steps that took a map
    out["reasons"] = reasons_;
    out["scale_reasons"] = scale_reasons_;
    out["last"] = last_;
  }

 private:
  const Settings& settings_;
  ros::Subscriber state_, scale_, stats_;
  std::mutex mutex_;
  bool is_open_ = false, is_proved_ = false, is_moving_ = false;
  double begun_s_ = 0, state_since_s_ = 0, scale_since_s_ = 0, proved_s_ = 0, moving_s_ = 0;
  std::map<std::string, double> processor_;
  std::size_t answers_ = 0, proved_ = 0, touching_expected_ = 0, touching_else_ = 0;
  ros::Time newest_;
  std::set<ros::Time> map_stamps_;
  std::vector<double> map_ages_, scales_, latencies_ms_, steps_ms_, clearances_ms_, own_voxels_ms_;
  std::map<std::string, std::size_t> reasons_, scale_reasons_;
  json last_;

  static std::vector<double> sorted(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values;
  }
  std::map<std::string, double> seconds() const {
    std::map<std::string, double> all{{"machine", machineSeconds()}, {"publisher", processorSeconds("self")}};
    for (const std::string& one : settings_.processes) {
      const std::size_t at = one.find('=');
      all[one.substr(0, at)] = processorSeconds(one.substr(at + 1));
    }
    return all;
  }
  void passState(double now_s) {
    if (is_proved_) proved_s_ += now_s - state_since_s_;
    state_since_s_ = now_s;
  }
  void passScale(double now_s) {
    if (is_moving_) moving_s_ += now_s - scale_since_s_;
    scale_since_s_ = now_s;
  }
  void onState(const deformable_ccd::State& m) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (is_open_) passState(ros::WallTime::now().toSec());
    is_proved_ = m.proved;
    if (!is_open_) return;
    for (const std::string& sentence : m.missing) ++reasons_[withoutNumbers(sentence)];
    if (m.holds_until == newest_) return;  // said between two answers
    newest_ = m.holds_until;
    ++answers_;
    proved_ += m.proved;
    touching_expected_ += m.touching == deformable_ccd::State::EXPECTED;
    touching_else_ += m.touching == deformable_ccd::State::LASTING || m.touching == deformable_ccd::State::NEW;
    if (m.checked_map) {
      map_stamps_.insert(m.map_stamp);
      map_ages_.push_back(m.map_age);
    }
  }
  void onScale(const deformable_ccd::SpeedScale& m) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (is_open_) passScale(ros::WallTime::now().toSec());
    is_moving_ = m.scale > 0;
    if (!is_open_) return;
    scales_.push_back(m.scale);
    if (m.scale == 0) ++scale_reasons_[withoutNumbers(m.reason)];
  }
  void onStats(const deformable_ccd::StepStats& m) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!is_open_ || !m.answered) return;
    latencies_ms_.push_back(1e3 * m.latency);
    steps_ms_.push_back(m.total_ms);
    for (const auto& stage : m.stages) {
      if (stage.name == "clearance") clearances_ms_.push_back(stage.ms);
      if (stage.name == "own_voxels" && stage.ms > 0) own_voxels_ms_.push_back(stage.ms);
    }
    last_ = {{"frames_received", m.frames_received}, {"frames_processed", m.frames_processed},
             {"frames_skipped", m.frames_skipped},   {"maps_received", m.maps_received},
             {"maps_refused", m.maps_refused},       {"map_leaves", m.map_leaves}};
  }
};

// --- all of it in time
// -------------------------------------------------------------------------------------------------

/// What comes again and again: its numbers' stamps, and how much later than those it is sent.
struct Stream {
  double rate_hz, lag_s, first_s;
  std::function<void(std::size_t number, double time_s)> send;
  std::size_t number = 0;
  double stampS() const { return first_s + static_cast<double>(number) / rate_hz; }
  double dueS() const { return stampS() + lag_s; }
};

int run(const Settings& settings) {
  std::ifstream file(settings.urdf);
  if (!file) throw std::runtime_error(settings.urdf + " is not there");
  const Arm arm({std::istreambuf_iterator<char>(file), {}});
  ros::NodeHandle node;
  const ros::Publisher tf_static = node.advertise<tf2_msgs::TFMessage>("/tf_static", 1, true);
  const ros::Publisher joint_states = node.advertise<sensor_msgs::JointState>("/joint_states", 10);
  const ros::Publisher cloths = node.advertise<sensor_msgs::PointCloud2>("/tracker/cloth", 10);
  Camera camera(node, settings, arm);
  tf2_msgs::TFMessage places;
  places.transforms = {transformOf("world", "base_link", Pose::Identity()),
                       transformOf("world", CAMERA_FRAME, cameraPose())};
  tf_static.publish(places);
  Witness witness(node, settings);
  ros::AsyncSpinner spinner(1);
  spinner.start();
  ros::WallDuration(1).sleep();  // until all have found each other

  const ros::Time begin = ros::Time::now() + ros::Duration(0.1);
  sensor_msgs::JointState joints;
  joints.name.assign(NAMES.begin(), NAMES.end());
  sensor_msgs::PointCloud2 cloth = cloudOf(ROWS, COLS, sensor_msgs::PointField::FLOAT64, sizeof(Vec3));
  cloth.header.frame_id = "world";
  cloth.is_dense = true;
  bool measures = false;
  std::size_t cloths_sent = 0, pictures_sent = 0;
  std::vector<Stream> streams{
      {JOINT_HZ, 0, 0,
       [&](std::size_t, double time_s) {
         joints.header.stamp = begin + ros::Duration(time_s);
         const auto now = jointsAt(time_s);
         joints.position.assign(now.begin(), now.end());
         joint_states.publish(joints);
       }},
      {CLOTH_HZ, TRACKER_LAG_S, CLOTH_S,
       [&](std::size_t, double time_s) {
         cloth.header.stamp = begin + ros::Duration(time_s);
         const Positions now = clothAt(arm.linksAt(time_s).at("tool0"), time_s);
         std::memcpy(cloth.data.data(), now.data(), cloth.data.size());
         cloths.publish(cloth);
         cloths_sent += measures;
       }},
      {settings.camera_hz, DRIVER_LAG_S, Film::stampOf(settings, 0), [&](std::size_t number, double time_s) {
         camera.publish(number, begin + ros::Duration(time_s));
         pictures_sent += measures;
       }}};
  double latest_s = 0;  // by which a message was sent late
  while (ros::ok()) {
    Stream& next = *std::min_element(streams.begin(), streams.end(),
                                     [](const Stream& a, const Stream& b) { return a.dueS() < b.dueS(); });
    if (!measures && next.dueS() >= settings.start_s) {
      measures = true;
      witness.begin();
    }
    if (next.dueS() >= settings.start_s + settings.seconds) break;
    const ros::Time due = begin + ros::Duration(next.dueS());
    if (!ros::Time::sleepUntil(due)) break;
    if (measures) latest_s = std::max(latest_s, (ros::Time::now() - due).toSec());
    next.send(next.number, next.stampS());
    ++next.number;
  }
  json out{{"camera_hz", settings.camera_hz}, {"noise_m", settings.noise_m}, {"flying_share", settings.flying_share}};
  witness.end(out);
  out["cloths_sent"] = cloths_sent;
  out["pictures_sent"] = pictures_sent;
  out["sent_late_s"] = latest_s;
  std::ofstream(settings.out) << out;
  return 0;
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  ros::init(argc, argv, "cell");
  dccd::benchmarks::Settings settings;
  CLI::App app("A cell with an arm, a cloth in its hand and a depth camera, live");
  app.add_option("--urdf", settings.urdf)->required();
  app.add_option("--out", settings.out, "JSON file")->required();
  app.add_option("--monitor", settings.monitor, "its name")->required();
  app.add_option("--process", settings.processes, "NAME=PID, whose share of a core is measured");
  app.add_option("--camera-hz", settings.camera_hz);
  app.add_option("--noise-m", settings.noise_m, "standard deviation of a depth");
  app.add_option("--lost-share", settings.lost_share, "of the pixels");
  app.add_option("--flying-share", settings.flying_share, "of the pixels, along edges");
  app.add_option("--start-s", settings.start_s, "before it measures");
  app.add_option("--seconds", settings.seconds);
  app.add_option("--stride", settings.stride, "of clouds: every so many pixels of every so many rows")
      ->check(CLI::Range(1, 16));
  app.add_flag("--clouds", settings.clouds, "publish organised clouds");
  app.add_flag("--images", settings.images, "publish depth images");
  CLI11_PARSE(app, argc, argv);
  try {
    return dccd::benchmarks::run(settings);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cell_publisher: %s\n", error.what());
    return 1;
  }
}
