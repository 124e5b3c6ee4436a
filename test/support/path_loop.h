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

/// A tool of 0.1 m whose lower side is `height` above a table of voxels, on which a cloth may lie.
class PathLoop {
 public:
  static constexpr double FULL_M_S = 0.5, FRAME_S = 1.0 / 30, TICK_S = FRAME_S / 10, BRAKES_M_S2 = 2, PICKS_UP_M_S2 = 1;
  static constexpr SpeedLaw LAW{2 * FRAME_S + 0.07, FULL_M_S / (0.8 * BRAKES_M_S2), 0.025};
  static constexpr double CLOTH_M_S = 0.2, TUBE_M = 0.003;

  PathLoop(std::uint64_t seed, const Vec3& way, double height_m, bool with_cloth)
      : random_(seed), way_(way.normalized()), length_m_(way.norm()) {
    TestStep scene;
    scene.bodies = {box({-0.05, -0.05, height_m}, {0.05, 0.05, height_m + 0.1})};
    if (with_cloth) scene.bodies.push_back(sheet(9, 9, {-0.4, -0.4, 0}, 0.1));
    step_ = scene.motion();
    step_.bodies[0].name = "tool";
    for (Body& body : step_.bodies) {
      body.self_collision = false;
      starts_.push_back(*body.t0);
    }
    std::vector<OccupiedLeaf> leaves;
    const int top = with_cloth ? -5 : 0;
    for (int x = -20; x < 40; ++x)
      for (int y = -20; y < 20; ++y)
        leaves.push_back({{static_cast<std::uint16_t>(32768 + x), static_cast<std::uint16_t>(32768 + y),
                           static_cast<std::uint16_t>(32768 + top - 1)},
                          1});
    step_.map.surface = VoxelSurface::build(0.05, leaves);
    brakes_m_s2_ = BRAKES_M_S2 * uniform(0.8, 1.2);
    shake_hz_ = uniform(0.5, 3);
    options_.clearance.wanted = true;
  }

  struct Run {
    bool arrived = false, touched = false;
    double mean_m_s = 0;
  };
  Run run(bool with_path) {
    Run result;
    double at_m = 0, speed_m_s = 0, scale = 0, time_s = 0;
    std::vector<std::pair<double, double>> coming;  // scales and when they are there
    for (int frame = 0; frame < 150 && at_m < length_m_; ++frame) {
      look(at_m, time_s);
      const Outcome outcome = detect(step_, options_, history_);
      result.touched = result.touched || (at_m > 0.02 && outcome.total_contacts > 0);
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

  /// Where all is now: the tool shakes by a third of its tube once it moves, the cloth ripples below where it lay.
  void look(double at_m, double time_s) {
    Positions tool = starts_[0];
    const double shakes_m = at_m > 0 ? TUBE_M / 3 * (1 - std::cos(2 * M_PI * shake_hz_ * time_s)) / 2 : 0;
    for (Vec3& p : tool) p += way_ * at_m + Vec3(0, 0, shakes_m);
    std::vector<Positions> now{tool};
    if (starts_.size() > 1) {
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
    const std::vector<SpeedBound> bounds{{FULL_M_S + 0.05}, {CLOTH_M_S}};
    if (!with_path) return speedScale(outcome, bounds, LAW).scale;
    IntendedPath path;
    path.bodies = {{0, {}}};
    path.deviation_m = TUBE_M;
    addPieces(
        [&](double t) {
          Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
          pose.translation() = way_ * (at_m + FULL_M_S * t);
          return std::vector<Eigen::Isometry3d>{pose};
        },
        1, 0, 0, 1e-3, 10, path);
    return search_.run(outcome, options_, bounds, LAW, path).scale.scale;
  }

  std::mt19937_64 random_;
  Vec3 way_;
  double length_m_, brakes_m_s2_ = 0, shake_hz_ = 1;
  Step step_;
  std::vector<Positions> starts_;
  Options options_;
  History history_;
  PathSearch search_;
};

}  // namespace test
}  // namespace dccd
