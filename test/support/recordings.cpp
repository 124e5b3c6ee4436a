#include "support/recordings.h"

#include <unistd.h>

#include <stdexcept>

namespace dccd {
namespace test {

namespace {

constexpr StampNs STEP_NS = 100000000;

std::vector<Body> bodies(bool with_distances) {
  std::vector<Body> all(3);
  all[0].name = "cloth";
  all[0].vertex_mask = {0};
  all[1].name = "finger";
  all[1].rigid = true;
  all[1].self_collision = false;
  all[2].name = "rope";
  all[2].motion = BodyMotionKind::STATIC;
  if (with_distances) {
    all[0].minimum_separation_m = 0.11;  // more than the grid's spacing: some of its own pairs are left out
    all[2].separations = {{0, 0.15}};
  }
  return all;
}

MonitorOptions withDefaults(MonitorOptions options) {
  options.store.max_vertex_step_m = 0;
  options.clock_body = 0;
  options.detector.rigid_tolerance_m = 0.01;
  options.detector.exclude_boxes = {Box{{9, 9, 9}, {10, 10, 10}}};
  return options;
}

/// Hands on what a step is made of; the answer is set by its owner.
class Capture : public StepListener {
 public:
  explicit Capture(StepRecording& recording) : recording_(recording) {}
  void onStep(const Step& step, const Options& options) override {
    recording_.step = step;
    recording_.options = options;
  }
  void onOutcome(const Outcome& outcome) override {
    recording_.has_answer = true;
    recording_.answer = outcome;
  }

 private:
  StepRecording& recording_;
};

}  // namespace

RecordedScene::RecordedScene(const MonitorOptions& options, bool with_map, bool with_distances)
    : monitor_(withDefaults(options), bodies(with_distances)),
      with_distances_(with_distances),
      grid_(std::make_shared<const Topology>(Topology::grid(4, 5))),
      finger_(std::make_shared<const Topology>(Topology::fromTriangles(4, {{0, 1, 2}, {0, 3, 1}}))),
      rope_(std::make_shared<const Topology>(Topology::polyline(4))) {
  if (with_map) {
    ObstacleMap map;
    map.surface = VoxelSurface::build(0.1, {{{32768, 32768, 32764}, 1}, {{32770, 32768, 32764}, 2}});
    map.stamp_ns = 1;
    monitor_.setMap(map);
  }
  push();
  Outcome first;
  monitor_.next(0, first);
}

void RecordedScene::push() {
  const StampNs stamp_ns = STEP_NS * ++frame_;
  const double fall = 0.16 * frame_;
  monitor_.push(2,
                {stamp_ns,
                 rope_,
                 {{0, 0, -0.02}, {0.1, 0.3, -0.03}, {0.2, 0, -0.02}, {0.5, 0.1, -0.3}},
                 false,
                 Eigen::Isometry3d::Identity()},
                0);
  const Positions at_rest{{-0.4, 0, 0}, {0.4, 0, 0}, {0, 0.3, 0.1}, {0, -0.3, 0.1}};
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Vec3(0.2, 0.15, -0.1);
  pose.rotate(Eigen::AngleAxisd(0.5 * frame_, Vec3::UnitZ()));
  Positions finger;
  for (const Vec3& p : at_rest) finger.push_back(pose * p);
  monitor_.push(1, {stamp_ns, finger_, finger, true, pose}, 0);
  Positions grid;
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 5; ++c) grid.emplace_back(0.1 * c + 0.013, 0.1 * r + 0.017, 0.3 - fall + 0.01 * ((r * c) % 3));
  }
  std::vector<double> radius_m;
  for (std::size_t i = 0; with_distances_ && i < grid.size(); ++i)
    radius_m.push_back(1e-3 * static_cast<double>(i % 4));
  monitor_.push(0, {stamp_ns, grid_, grid, false, Eigen::Isometry3d::Identity(), radius_m}, 0);
}

Outcome RecordedScene::nextFrames() {
  push();
  Outcome outcome;
  if (!monitor_.next(0, outcome)) throw std::logic_error("the scene's frames make no step");
  return outcome;
}

StepRecording recordScene(const MonitorOptions& options, bool with_map, bool with_distances) {
  RecordedScene scene(options, with_map, with_distances);
  scene.nextFrames();
  StepRecording recording;
  Capture capture(recording);
  scene.monitor().setListener(&capture);
  scene.nextFrames();
  scene.monitor().setListener(nullptr);
  recording.note = "test";
  return recording;
}

std::vector<std::uint8_t> recordingBytes(const StepRecording& recording) {
  std::vector<std::uint8_t> bytes;
  serialise(recording, [&](const void* data, std::size_t size) {
    const auto* begin = static_cast<const std::uint8_t*>(data);
    bytes.insert(bytes.end(), begin, begin + size);
  });
  return bytes;
}

}  // namespace test
}  // namespace dccd
