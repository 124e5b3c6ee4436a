// An arm that says where it means to go, in a loop: by ~speed_scale along its path, or by bounds alone.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "dccd/intended.h"
#include "support/closed_meshes.h"

namespace dccd {
namespace test {

/// A tool of 0.1 m whose lower side is `height` above a table of voxels. A cloth may lie on that, or a towel of 0.2 m
/// hang from the tool by its upper row: it swings, and once it is over the table it is bent over its edge.
class PathLoop {
 public:
  static constexpr double FULL_M_S = 0.5, FRAME_S = 1.0 / 30, TICK_S = FRAME_S / 10, BRAKES_M_S2 = 2, PICKS_UP_M_S2 = 1;
  static constexpr SpeedLaw LAW{2 * FRAME_S + 0.07, FULL_M_S / (0.8 * BRAKES_M_S2), 0.025};
  static constexpr double CLOTH_M_S = 0.2, TUBE_M = 0.003;
  static constexpr double TOWEL_M_S = 1, HANGS_M_S = 0.8, GAP_M = 0.03, SPACING_M = 0.025;  // of the towel
  enum class Cloth { NONE, LIES, HANGS };
  inline static const Vec3 LAYS{0.5, 0, 0};

  PathLoop(std::uint64_t seed, const Vec3& way, double height_m, Cloth cloth)
      : random_(seed), way_(way.normalized()), length_m_(way.norm()), cloth_(cloth) {
    TestStep scene;
    scene.bodies = {box({-0.05, -0.05, height_m}, {0.05, 0.05, height_m + 0.1})};
    if (cloth == Cloth::LIES) scene.bodies.push_back(sheet(9, 9, {-0.4, -0.4, 0}, 0.1));
    if (cloth == Cloth::HANGS) scene.bodies.push_back(sheet(9, 5, {0, 0, 0}, SPACING_M));
    step_ = scene.motion();
    step_.bodies[0].name = "tool";
    for (Body& body : step_.bodies) {
      body.self_collision = false;
      starts_.push_back(*body.t0);
      if (cloth == Cloth::HANGS && starts_.size() == 2)  // its rows go down
        for (Vec3& p : starts_[1]) p = Vec3(0, p.y() - 2 * SPACING_M, height_m - GAP_M - p.x());
    }
    std::vector<OccupiedLeaf> leaves;
    const int top = cloth == Cloth::LIES ? -5 : 0;
    for (int x = cloth == Cloth::HANGS ? EDGE : -20; x < 40; ++x)
      for (int y = -20; y < 20; ++y)
        leaves.push_back({{static_cast<std::uint16_t>(32768 + x), static_cast<std::uint16_t>(32768 + y),
                           static_cast<std::uint16_t>(32768 + top - 1)},
                          1});
    step_.map.surface = VoxelSurface::build(0.05, leaves);
    if (cloth == Cloth::HANGS) {  // the tool holds the upper row, and the rest may lie on the table
      for (Index v = 0; v < 5; ++v) step_.bodies[1].vertex_mask.push_back(v);
      options_.expected.resize(1);
      options_.expected[0].partners[0].body = 1;
      options_.expected[0].partners[1].body = OBSTACLE_BODY;
    }
    brakes_m_s2_ = BRAKES_M_S2 * uniform(0.8, 1.2);
    shake_hz_ = uniform(0.5, 3);
    options_.clearance.wanted = true;
  }

  struct Run {
    bool arrived = false, touched = false;
    double left_m_s = 0;  // how fast the towel left the tool, at most, from frame to frame
    double mean_m_s = 0;
  };
  Run run(bool with_path) {
    Run result;
    double at_m = 0, speed_m_s = 0, scale = 0, time_s = 0;
    std::vector<std::pair<double, double>> coming;  // scales and when they are there
    for (int frame = 0; frame < 150 && at_m < length_m_; ++frame) {
      look(at_m, time_s, result);
      const Outcome outcome = detect(step_, options_, history_);
      result.touched = result.touched || (at_m > 0.02 && hasUnexpected(outcome));
      coming.push_back({time_s + uniform(0.03, 0.07), scaleOf(outcome, at_m, with_path)});
      for (int tick = 0; tick < 10; ++tick) {
        time_s += TICK_S;
        while (!coming.empty() && coming.front().first <= time_s) {
          scale = coming.front().second;
          coming.erase(coming.begin());
        }
        const double wanted = scale * FULL_M_S;
        speed_m_s = wanted > speed_m_s ? std::min(wanted, speed_m_s + PICKS_UP_M_S2 * TICK_S)
                                       : std::max(wanted, speed_m_s - brakes_m_s2_ * TICK_S);
        at_m += speed_m_s * TICK_S;
        swing(speed_m_s);
      }
    }
    result.arrived = at_m >= length_m_;
    result.mean_m_s = at_m / time_s;
    return result;
  }
  /// Without anything in its way.
  double freeSpeed() const { return length_m_ / (length_m_ / FULL_M_S + FULL_M_S / PICKS_UP_M_S2 / 2); }

 private:
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }

  static bool hasUnexpected(const Outcome& outcome) {
    return std::any_of(outcome.contacts.begin(), outcome.contacts.end(), [](const Contact& c) { return !c.expected; });
  }

  /// A pendulum of two thirds of its length.
  void swing(double speed_m_s) {
    const double length_m = 0.2 * 2 / 3, picks_up = (speed_m_s - std::exchange(speed_m_s_, speed_m_s)) / TICK_S;
    turns_ += TICK_S * (-9.81 * std::sin(angle_) / length_m - picks_up * std::cos(angle_) / length_m - 4 * turns_);
    angle_ += TICK_S * turns_;
  }
  /// Straight down from the tool, turned by its angle; or to the table's edge, and down from there.
  Positions towel(double at_m) const {
    Positions now = starts_[1];
    const double edge_m = 0.05 * EDGE - 0.002, top_m = 0.002;
    for (Vec3& p : now) {
      const Vec3 from(at_m, p.y(), starts_[1][0].z() + way_.z() * at_m);
      const double down_m = starts_[1][0].z() - p.z(), to_edge_m = std::hypot(from.x() - edge_m, from.z() - top_m);
      const Vec3 hangs = from + down_m * Vec3(std::sin(angle_), 0, -std::cos(angle_));
      const bool is_bent = from.x() > edge_m;
      const Vec3 corner(edge_m, p.y(), top_m);
      p = !is_bent             ? Vec3(std::min(hangs.x(), std::max(edge_m, from.x())), p.y(), hangs.z())
          : down_m < to_edge_m ? Vec3(from + (corner - from) * (down_m / to_edge_m))
                               : Vec3(corner - Vec3(0, 0, down_m - to_edge_m));
    }
    return now;
  }

  /// Where all is now: the tool shakes by a third of its tube once it moves, the cloth ripples below where it lay.
  void look(double at_m, double time_s, Run& run) {
    Positions tool = starts_[0];
    const double shakes_m = at_m > 0 ? TUBE_M / 3 * (1 - std::cos(2 * M_PI * shake_hz_ * time_s)) / 2 : 0;
    for (Vec3& p : tool) p += way_ * at_m + Vec3(0, 0, shakes_m);
    std::vector<Positions> now{tool};
    if (cloth_ == Cloth::HANGS) {
      now.push_back(towel(at_m));
      for (std::size_t v = 0; at_m > 0 && v < now[1].size(); ++v)
        run.left_m_s =
            std::max(run.left_m_s,
                     (now[1][v] - (*step_.bodies[1].t1)[v] - (tool[0] - (*step_.bodies[0].t1)[0])).norm() / FRAME_S);
    } else if (starts_.size() > 1) {
      Positions cloth = starts_[1];
      for (Vec3& p : cloth)
        p.z() -= 0.004 * (1 - std::cos(2 * M_PI * shake_hz_ * time_s + 9 * p.x())) * (p.head<2>().norm() > 0.2);
      now.push_back(cloth);
    }
    for (std::size_t b = 0; b < now.size(); ++b) {
      Body& body = step_.bodies[b];
      body.t0 = step_.stamp_ns == 0 ? share(now[b]) : body.t1;
      body.t1 = share(now[b]);
      body.pose_t1 = Eigen::Isometry3d::Identity();
    }
    step_.start_ns = step_.stamp_ns;
    step_.stamp_ns += static_cast<StampNs>(1e9 * FRAME_S);
  }

  double scaleOf(const Outcome& outcome, double at_m, bool with_path) {
    const bool hangs = cloth_ == Cloth::HANGS;
    std::vector<SpeedBound> bounds{{FULL_M_S + 0.05}, {hangs ? TOWEL_M_S : CLOTH_M_S}};
    if (!with_path) return speedScale(outcome, bounds, LAW).scale;
    IntendedPath path;
    path.bodies = {{0, {}}};
    if (hangs) {
      bounds[1].carrier = 0;
      bounds[1].relative_m_s = HANGS_M_S;
      path.bodies.push_back({1, {}, 0, HANGS_M_S});
    }
    path.deviation_m = TUBE_M;
    addPieces(
        [&](double t) {
          Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
          pose.translation() = way_ * (at_m + FULL_M_S * t);
          return std::vector<Eigen::Isometry3d>(path.bodies.size(), pose);
        },
        1, 0, 0, 1e-3, 10, path);
    return search_.run(outcome, options_, bounds, LAW, path).scale.scale;
  }

  static constexpr int EDGE = 3;  // where the table begins, in voxels
  std::mt19937_64 random_;
  Vec3 way_;
  double length_m_, brakes_m_s2_ = 0, shake_hz_ = 1;
  Cloth cloth_;
  double angle_ = 0, turns_ = 0, speed_m_s_ = 0;  // of the towel [rad, rad/s]; of the tool [m/s]
  Step step_;
  std::vector<Positions> starts_;
  Options options_;
  History history_;
  PathSearch search_;
};

}  // namespace test
}  // namespace dccd
