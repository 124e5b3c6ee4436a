// Many frames through all of the node but the network: bytes in, decoder, pipeline, monitor, flight recorder, messages
// out. Memory stays flat, counters add up, and the same step gives the same bytes however long the monitor has run. 1e3
// frames; 1e5 with DEFORMABLE_CCD_LONG=1.
#include "output/output_messages.h"

#include <unistd.h>

#include <cmath>
#include <random>

#include <deformable_ccd/MeshStamped.h>
#include <gtest/gtest.h>

#include "node/monitor_pipeline.h"
#include "record/flight_recorder.h"
#include "ros/support/bytes_of.h"
#include "support/heap.h"
#include "support/query_property.h"
#include "support/recordings.h"

namespace dccd {
namespace {

constexpr std::size_t ROWS = 8, COLS = 8;
constexpr StampNs FRAME_NS = 10000000;

MonitorConfig configuration() {
  MonitorConfig config;
  config.fixed_frame = "world";
  BodyConfig body;
  body.body.name = "cloth";
  body.topic = "cloth";
  config.bodies.push_back(body);
  config.monitor.store.max_vertex_step_m = 0;
  config.monitor.detector.obstacle_expected = true;
  config.monitor.look_ahead_s = 0.02;
  return config;
}

/// A cloth that is thrown about over a map, mostly through itself.
class Stream {
 public:
  MeshMessage next(bool known, bool second) {
    std::mt19937 fixed(second ? 2 : 1);
    std::mt19937& random = known ? fixed : random_;
    std::uniform_real_distribution<double> noise(-0.04, 0.04);
    deformable_ccd::MeshStamped mesh;
    stamp_ns_ += FRAME_NS;
    mesh.header.stamp.fromNSec(static_cast<std::uint64_t>(stamp_ns_));
    mesh.header.frame_id = "world";
    for (std::size_t i = 0; i < ROWS * COLS; ++i) {
      geometry_msgs::Point p;
      p.x = 0.05 * static_cast<double>(i % COLS) + noise(random);
      p.y = 0.05 * static_cast<double>(i / COLS) + noise(random);
      p.z = 0.05 + noise(random);
      mesh.vertices.push_back(p);
    }
    const Topology grid = Topology::grid(ROWS, COLS);
    for (const Face& face : grid.faces()) {
      shape_msgs::MeshTriangle triangle;
      std::copy(face.begin(), face.end(), triangle.vertex_indices.begin());
      mesh.triangles.push_back(triangle);
    }
    MeshMessage raw;
    raw.datatype = "deformable_ccd/MeshStamped";
    raw.bytes = test::bytesOf(mesh);
    return raw;
  }

 private:
  std::mt19937 random_{7};
  StampNs stamp_ns_ = 1000000000;
};

std::vector<std::uint8_t> answerBytes(const Outcome& outcome) {
  StepRecording recording;
  recording.answer = outcome;
  return test::recordingBytes(recording);
}

TEST(Soak, FlatMemoryAndTheSameBytesForTheSameStep) {
  const bool is_long = test::longRun();
  const std::size_t frames = is_long ? 100000 : 1000, period = is_long ? 1000 : 100;
  const MonitorConfig config = configuration();
  TransformFeed feed;
  MonitorPipeline pipeline(config, feed);
  FlightRecorder recorder(3, "/nonexistent");  // nothing is a surprise here, so nothing is written
  pipeline.monitor().setListener(&recorder);
  LoadedMap map;
  map.surface = VoxelSurface::build(0.05, {{{32768, 32768, 32767}, 1}, {{32772, 32770, 32766}, 2}});
  pipeline.setMap(map, 0);

  Stream stream;
  std::vector<std::uint8_t> expected;
  std::size_t known_steps = 0, contacts = 0, first_memory = 0;
  for (std::size_t i = 0; i < frames; ++i) {
    const bool known = i % period < 2;
    pipeline.take(0, stream.next(known, i % period == 1));
    Outcome outcome;
    ASSERT_TRUE(pipeline.nextOutcome(static_cast<std::int64_t>(i) * FRAME_NS, outcome));
    ASSERT_TRUE(outcome.answered || i == 0) << outcome.reason;
    contacts += outcome.contacts.size();
    // What is published is built, too.
    StatsContext context;
    context.frames = pipeline.monitor().total();
    ASSERT_EQ(toContactArray(outcome, pipeline.monitor().bodies(), "world").contacts.size(), outcome.contacts.size());
    ASSERT_EQ(toStepStats(outcome, context, "world").frames_received, i + 1);
    if (i > 0) {
      ASSERT_TRUE(pipeline.monitor().predict().answered);
    }
    if (i % period != 1) continue;
    const std::vector<std::uint8_t> bytes = answerBytes(outcome);
    if (expected.empty()) expected = bytes;
    ASSERT_EQ(bytes, expected) << "frame " << i;
    ++known_steps;
    // Bytes that are in use; a sanitizer's allocator says 0. Buffers have found their size by the second period.
    const std::size_t memory = test::heapInUse();
    if (known_steps == 2) first_memory = memory;
    if (known_steps > 2) {
      ASSERT_LE(memory, first_memory + (256 << 10)) << "frame " << i;
    }
  }
  EXPECT_EQ(known_steps, frames / period);
  EXPECT_GT(contacts, frames) << "there was something to do";
  const FrameCounters counters = pipeline.monitor().total();
  EXPECT_EQ(counters.received, frames);
  EXPECT_EQ(counters.processed(), frames - 1);
  EXPECT_EQ(counters.started(), 1u);
  EXPECT_EQ(counters.waiting(), 0u);
  EXPECT_TRUE(recorder.takeSurprise().empty());
}

}  // namespace
}  // namespace dccd
