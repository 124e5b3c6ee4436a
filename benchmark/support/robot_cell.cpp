#include "support/robot_cell.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <random>
#include <set>
#include <utility>

#include "input/stl_file.h"
#include "support/data.h"

namespace dccd {
namespace benchmarks {
namespace {

constexpr int ROWS = 20, COLS = 30;
constexpr double SPACING_M = 0.02, VOXEL_M = 0.02;

struct Origin {
  Vec3 xyz, rpy;

  Eigen::Isometry3d pose() const {
    return Eigen::Translation3d(xyz) * Eigen::AngleAxisd(rpy.z(), Vec3::UnitZ()) *
           Eigen::AngleAxisd(rpy.y(), Vec3::UnitY()) * Eigen::AngleAxisd(rpy.x(), Vec3::UnitX());
  }
};

/// The joint before the link, where the link's mesh is, and the size of what stands for it: a capsule along x.
struct Link {
  const char* name;
  Origin joint, mesh;
  double length_m, radius_m;
  std::size_t rings;
};

constexpr double HALF_TURN = M_PI, QUARTER = M_PI / 2;

/// Of the ur5e's URDF.
const std::array<Link, RobotCell::LINKS>& links() {
  static const std::array<Link, RobotCell::LINKS> LINKS{{
      {"base", {{0, 0, 0}, {0, 0, HALF_TURN}}, {{0, 0, 0}, {0, 0, HALF_TURN}}, 0.1, 0.075, 9},
      {"shoulder", {{0, 0, 0.1625}, {0, 0, 0}}, {{0, 0, 0}, {0, 0, HALF_TURN}}, 0.15, 0.06, 29},
      {"upperarm", {{0, 0, 0}, {QUARTER, 0, 0}}, {{0, 0, 0.138}, {QUARTER, 0, -QUARTER}}, 0.55, 0.06, 41},
      {"forearm", {{-0.425, 0, 0}, {0, 0, 0}}, {{0, 0, 0.007}, {QUARTER, 0, -QUARTER}}, 0.5, 0.05, 22},
      {"wrist1", {{-0.3922, 0, 0.1333}, {0, 0, 0}}, {{0, 0, -0.127}, {QUARTER, 0, 0}}, 0.12, 0.04, 25},
      {"wrist2", {{0, -0.0997, 0}, {QUARTER, 0, 0}}, {{0, 0, -0.0997}, {0, 0, 0}}, 0.12, 0.04, 28},
      {"wrist3", {{0, 0.0996, 0}, {QUARTER, HALF_TURN, HALF_TURN}}, {{0, 0, -0.0989}, {QUARTER, 0, 0}}, 0.05, 0.035, 4},
  }};
  return LINKS;
}

/// Of its SRDF, by the numbers of the links.
bool neverMeet(std::size_t a, std::size_t b) {
  static const std::set<std::pair<std::size_t, std::size_t>> NEVER{{0, 1}, {0, 2}, {0, 4}, {2, 3}, {3, 4}, {1, 2},
                                                                   {1, 4}, {1, 5}, {4, 5}, {4, 6}, {5, 6}};
  return NEVER.count(std::minmax(a, b)) > 0;
}

test::TriangleShape standIn(const Link& link) {
  return test::revolution(link.rings, 24, link.length_m / 2, [&](double x) {
    const double left_m = link.length_m / 2 - std::abs(x);
    return left_m >= link.radius_m ? link.radius_m : std::sqrt(std::max(0.0, left_m * (2 * link.radius_m - left_m)));
  });
}

/// [rad] Some half a radian a second.
double jointAt(std::size_t joint, double time_s) {
  static constexpr double MIDDLE[] = {0.3, -1.5, 1.5, -1.6, -1.5, 0.4}, SWING[] = {0.6, 0.15, 0.2, 0.2, 0.3, 0.5};
  return MIDDLE[joint] + SWING[joint] * std::sin((0.7 + 0.1 * static_cast<double>(joint)) * time_s);
}

}  // namespace

RobotCell::RobotCell(bool against_links) {
  const std::string folder = test::dataDir().empty() ? "" : test::dataDir() + "/robots/ur5e/meshes/collision/";
  real_ = !folder.empty() && std::filesystem::exists(folder);
  Body cloth;
  cloth.name = "cloth";
  cloth.topology = share(Topology::grid(ROWS, COLS));
  bodies_.push_back(cloth);
  for (std::size_t l = 0; l < LINKS; ++l) {
    const Link& link = links()[l];
    if (real_) {
      MeshFile file = loadStlFile(folder + link.name + ".stl");
      shapes_.push_back({std::move(file.positions), std::move(file.faces)});
    } else {
      shapes_.push_back(standIn(link));
    }
    for (Vec3& p : shapes_.back().vertices) p = real_ ? link.mesh.pose() * p : p;
    Body body;
    body.name = link.name;
    body.rigid = true;
    body.topology = share(Topology::fromTriangles(shapes_.back().vertices.size(), shapes_.back().faces));
    for (std::size_t other = 0; other < LINKS; ++other) {
      if (other != l && (!against_links || neverMeet(l, other)))
        body.not_against.push_back(static_cast<std::uint16_t>(1 + other));
    }
    bodies_.push_back(body);
  }
}

std::size_t RobotCell::triangles() const {
  std::size_t count = 0;
  for (const test::TriangleShape& shape : shapes_) count += shape.faces.size();
  return count;
}

RobotCell::Frame RobotCell::frameAt(int k) const {
  const double time_s = PERIOD_S * k;
  Frame frame;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  frame.positions.resize(1);
  for (std::size_t l = 0; l < LINKS; ++l) {
    pose = pose * links()[l].joint.pose();
    if (l > 0) pose.rotate(Eigen::AngleAxisd(jointAt(l - 1, time_s), Vec3::UnitZ()));
    Positions positions;
    for (const Vec3& p : shapes_[l].vertices) positions.push_back(pose * p);
    frame.positions.push_back(share(std::move(positions)));
    frame.poses.push_back(pose);
  }
  // By one side it hangs from a tool of 0.1 m, and swings.
  const Vec3 hand = pose * Vec3(0, 0, 0.1);
  Positions cloth;
  for (int row = 0; row < ROWS; ++row) {
    for (int col = 0; col < COLS; ++col) {
      const double down = SPACING_M * row, along = SPACING_M * (col - COLS / 2);
      const double swing = 0.3 * down * std::sin(3 * time_s) + 0.15 * down * std::sin(12 * along + 4 * time_s);
      cloth.emplace_back(hand + Vec3(swing, along, -down));
    }
  }
  frame.positions[0] = share(std::move(cloth));
  return frame;
}

/// What a camera sees: the upper side of a table 0.1 m below the arm's foot, two boxes on it, and voxels that come and
/// go along edges.
std::shared_ptr<const VoxelSurface> RobotCell::mapAt(int k) const {
  std::mt19937 random(static_cast<std::uint32_t>(k));
  std::vector<OccupiedLeaf> leaves;
  const auto add = [&](int x, int y, int z) {
    leaves.push_back({{static_cast<std::uint16_t>(32768 + x), static_cast<std::uint16_t>(32768 + y),
                       static_cast<std::uint16_t>(32768 + z)},
                      1});
  };
  constexpr int TOP = -6, HALF = 40;
  for (int x = -HALF; x < HALF; ++x) {
    for (int y = -HALF; y < HALF; ++y) {
      const bool edge = x == -HALF || x == HALF - 1 || y == -HALF || y == HALF - 1;
      if (!edge || random() % 4 != 0) add(x, y, TOP);
      if (edge && random() % 8 == 0) add(x, y, TOP + 1);
      for (const auto& [x0, y0, side, height] : {std::array{18, 14, 8, 10}, std::array{-30, -28, 6, 6}}) {
        const bool in = x >= x0 && x < x0 + side && y >= y0 && y < y0 + side;
        const bool wall = in && (x == x0 || x == x0 + side - 1 || y == y0 || y == y0 + side - 1);
        for (int z = TOP + 1; in && z <= TOP + height; ++z) {
          if (z == TOP + height || (wall && random() % 16 != 0)) add(x, y, z);
        }
      }
    }
  }
  return VoxelSurface::build(VOXEL_M, std::move(leaves));
}

Step RobotCell::step(int k) {
  if (next_ != k) known_ = frameAt(k);
  Frame next = frameAt(k + 1);
  if (!map_ || k % 2 == 0) map_ = mapAt(k / 2);
  Step step;
  step.start_ns = static_cast<StampNs>(std::llround(1e9 * PERIOD_S * k));
  step.stamp_ns = static_cast<StampNs>(std::llround(1e9 * PERIOD_S * (k + 1)));
  step.bodies = bodies_;
  for (std::size_t b = 0; b < step.bodies.size(); ++b) {
    Body& body = step.bodies[b];
    body.t0 = known_.positions[b];
    body.t1 = next.positions[b];
    if (b == 0) continue;
    body.pose_t0 = known_.poses[b - 1];
    body.pose_t1 = next.poses[b - 1];
    body.turns = body.pose_t0.linear() != body.pose_t1.linear();
  }
  step.map.surface = map_;
  step.map.stamp_ns = step.start_ns;
  known_ = std::move(next);
  next_ = k + 1;
  return step;
}

}  // namespace benchmarks
}  // namespace dccd
