// Frames that a monitor gets one after the other, its events of patches in words; tables and cloths to feed it with.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "dccd/stream.h"
#include "support/shapes.h"

namespace dccd {
namespace test {

constexpr StampNs PERIOD_NS = 33000000;

/// The table's top is the plane z = 0.
inline std::shared_ptr<const VoxelSurface> table(double resolution_m) {
  const int n = static_cast<int>(std::ceil(1.0 / resolution_m));
  return VoxelSurface::build(resolution_m, voxelsOfBox({-n, -n, -1}, {n, n, 0}));
}

/// A strip of cloth along x; height(column) [m].
template <class Height>
Positions strip(std::size_t rows, std::size_t cols, double cell_m, const Height& height) {
  Positions x;
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < cols; ++c) {
      x.emplace_back(cell_m * static_cast<double>(c) + 0.003, cell_m * static_cast<double>(r) + 0.004, height(c));
    }
  }
  return x;
}

class Stream {
 public:
  explicit Stream(std::vector<std::shared_ptr<const Topology>> topologies, MonitorOptions options = {})
      : topologies_(std::move(topologies)), options_(options) {
    options_.detector.patches = true;
    std::vector<Body> bodies(topologies_.size());
    for (std::size_t b = 0; b < bodies.size(); ++b) bodies[b].name = "body_" + std::to_string(b);
    monitor_ = std::make_unique<Monitor>(options_, bodies);
  }
  Monitor& monitor() { return *monitor_; }
  MonitorOptions& options() { return options_; }
  void setMap(std::shared_ptr<const VoxelSurface> surface) {
    monitor_->setMap({std::move(surface), 1, Eigen::Isometry3d::Identity(), {}});
  }
  StampNs now() const { return stamp_ns_; }
  /// From the next step on.
  void expect(const std::vector<Expectation>& expected) {
    options_.detector.expected = expected;
    monitor_->setOptions(options_);
  }
  void wait(StampNs ns) { stamp_ns_ += ns; }

  /// The next frame of each body, and what comes of it. radius_m: of each vertex.
  Outcome feed(const std::vector<Positions>& positions, double radius_m = 0) {
    stamp_ns_ += PERIOD_NS;
    for (std::size_t b = positions.size(); b-- > 0;) {
      MeshFrame frame;
      frame.stamp_ns = stamp_ns_;
      frame.topology = topologies_[b];
      frame.positions = positions[b];
      if (radius_m > 0) frame.radius_m.assign(positions[b].size(), radius_m);
      monitor_->push(b, std::move(frame), 0);
    }
    Outcome outcome;
    EXPECT_TRUE(monitor_->next(0, outcome));
    take(outcome);
    return outcome;
  }
  void take(const Outcome& outcome) {
    for (const PatchEvent& event : outcome.patch_events) {
      text_ += (text_.empty() ? "" : ", ") + std::string(toString(event.kind)) + " " + std::to_string(event.id);
      for (const std::uint64_t other : event.others) text_ += "+" + std::to_string(other);
      if (event.kind == PatchEventKind::BEGAN && event.beginning != PatchBeginning::NEW) {
        text_ += std::string(" ") + toString(event.beginning);
      }
      if (event.kind == PatchEventKind::ENDED && event.to_ns == UNKNOWN_NS) text_ += " unknown";
      events_.push_back(event);
    }
  }
  /// All events, in words.
  const std::string& text() const { return text_; }
  const std::vector<PatchEvent>& events() const { return events_; }

 private:
  std::vector<std::shared_ptr<const Topology>> topologies_;
  MonitorOptions options_;
  std::unique_ptr<Monitor> monitor_;
  StampNs stamp_ns_ = 1000000000;
  std::string text_;
  std::vector<PatchEvent> events_;
};

inline std::shared_ptr<const Topology> grid(std::size_t rows, std::size_t cols) {
  return share(Topology::grid(rows, cols));
}

/// A cloth, cells of 2 cm, and the table.
class ClothOnTable : public Stream {
 public:
  ClothOnTable(std::size_t rows, std::size_t cols, const MonitorOptions& options = {})
      : Stream({grid(rows, cols)}, options), rows_(rows), cols_(cols) {
    setMap(table(0.05));
  }
  /// At the heights that its columns have.
  template <class Height>
  Outcome lift(const Height& height) {
    return feed({strip(rows_, cols_, 0.02, height)});
  }
  /// All of it at one height.
  Outcome at(double z) {
    return lift([z](std::size_t) { return z; });
  }

 private:
  std::size_t rows_, cols_;
};

}  // namespace test
}  // namespace dccd
