// A monitor of frames of two triangles, or of a floor and a tip above it, one outcome at a time.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "dccd/stream.h"

namespace dccd {
namespace test {

constexpr StampNs MS = 1000000;
constexpr std::int64_t NOW = 0, LATER = 10000 * MS;

/// A triangle in the plane z = 0 and one above it that points down with vertex 3.
inline std::shared_ptr<const Topology> twoTriangles() {
  static const auto topology = std::make_shared<const Topology>(Topology::fromTriangles(6, {{0, 1, 2}, {3, 4, 5}}));
  return topology;
}
inline MeshFrame pair(StampNs stamp_ns, double tip_z) {
  return {stamp_ns,
          twoTriangles(),
          {{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}, {0, 0, tip_z}, {0.5, 0, tip_z + 1}, {-0.5, 0, tip_z + 1}}};
}

inline std::shared_ptr<const Topology> oneTriangle() {
  static const auto topology = std::make_shared<const Topology>(Topology::fromTriangles(3, {{0, 1, 2}}));
  return topology;
}
inline MeshFrame floor(StampNs stamp_ns, double z) {
  return {stamp_ns, oneTriangle(), {{-1, -1, z}, {1, -1, z}, {0, 1, z}}};
}
inline MeshFrame tip(StampNs stamp_ns, double z) {
  return {stamp_ns, oneTriangle(), {{0, 0, z}, {0.5, 0, z + 1}, {-0.5, 0, z + 1}}};
}

inline MonitorOptions loose() {
  MonitorOptions options;
  options.store.max_vertex_step_m = 0;
  return options;
}

inline Body named(const std::string& name) {
  Body body;
  body.name = name;
  return body;
}

inline Outcome only(Monitor& monitor, std::int64_t now = NOW) {
  Outcome outcome, more;
  EXPECT_TRUE(monitor.next(now, outcome));
  EXPECT_FALSE(monitor.next(now, more));
  return outcome;
}

inline void expectAddsUp(const Monitor& monitor) {
  const FrameCounters all = monitor.total();
  EXPECT_EQ(all.received, all.processed() + all.started() + all.skipped() + all.waiting());
}

class OneBody : public ::testing::Test {
 protected:
  Monitor monitor{loose(), {named("cloth")}};
  Outcome feed(MeshFrame frame) {
    monitor.countReceived(0);
    monitor.push(0, std::move(frame), NOW);
    return only(monitor);
  }
};

}  // namespace test
}  // namespace dccd
