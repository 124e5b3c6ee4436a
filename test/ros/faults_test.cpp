// What real systems do to a monitor: the right status within one step, recovery within two, counters that add up.
#include "ros/support/live_tests.h"
#include "ros/support/monitor_fixture.h"

#include <sstream>

#include "record/step_replay.h"

namespace dccd {
namespace test {
namespace {

constexpr std::size_t MONITORS = 3;  // in faults.test; each listens to /tf

struct Recording : MonitorTest {
  Recording() : MonitorTest("/recording") {}
};

TEST_F(Recording, RecordStepWritesWhatReplaysToTheSameBits) {
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/recording/mesh");
  send(publisher, meshStamped(tipAbove(1), 10));
  send(publisher, meshStamped(tipAbove(0.5), 10.1));
  const deformable_ccd::ContactArray outcome = send(publisher, meshStamped(tipAbove(-3), 10.2));
  ASSERT_FALSE(outcome.contacts.empty());
  const auto written = trigger("record_step");
  ASSERT_TRUE(written.success) << written.message;
  std::istringstream lines(written.message);
  std::vector<StepRecording> steps;
  for (std::string file; std::getline(lines, file);) steps.push_back(readRecordingFile(file));
  ASSERT_EQ(steps.size(), 2u) << "record_steps is 2";
  EXPECT_EQ(steps[0].step.start_ns, 10100000000) << "the newest first";
  EXPECT_EQ(steps[0].answer.contacts.size(), outcome.contacts.size());
  for (const StepRecording& step : steps) {
    const StepReplay replay = replayStep(step);
    EXPECT_TRUE(replay.differences.empty()) << replay.differences.front();
  }
  const auto& message = outcome.contacts.front();
  const Contact& contact = steps[0].answer.contacts.front();
  EXPECT_EQ(message.toc_lower, contact.toc_lower);
  EXPECT_EQ(message.toc_upper, contact.toc_upper);
}

struct Unwritable : MonitorTest {
  Unwritable() : MonitorTest("/unwritable") {}
};

TEST_F(Unwritable, ARecordingThatCannotBeWrittenIsAnAnswerNotAnEnd) {
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/unwritable/mesh");
  const auto early = trigger("record_step");
  EXPECT_FALSE(early.success);
  EXPECT_NE(early.message.find("no step"), std::string::npos) << early.message;
  send(publisher, meshStamped(tipAbove(1), 10));
  EXPECT_EQ(send(publisher, meshStamped(tipAbove(0.5), 10.1)).status, deformable_ccd::ContactArray::OK);
  const auto answer = trigger("record_step");
  EXPECT_FALSE(answer.success);
  EXPECT_NE(answer.message.find("cannot be written"), std::string::npos) << answer.message;
  EXPECT_EQ(send(publisher, meshStamped(tipAbove(0.4), 10.2)).status, deformable_ccd::ContactArray::OK)
      << "and goes on";
  expectAddsUp();
}

TEST_F(Recording, TfThatStopsAndComesBack) {
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/recording/mesh");
  ros::Publisher tf = advertiseAndWait<tf2_msgs::TFMessage>(node, "/tf", false, MONITORS);
  const Mesh mesh = tipAbove(1);
  tf.publish(transformAt(100, "camera", {0, 0, 0}));
  tf.publish(transformAt(100.1, "camera", {0, 0, 0}));
  send(publisher, meshStamped(mesh, 100, "camera"));
  EXPECT_EQ(send(publisher, meshStamped(mesh, 100.1, "camera")).status, deformable_ccd::ContactArray::OK);
  for (const double stamp_s : {100.2, 100.3}) {
    const deformable_ccd::ContactArray lost = send(publisher, meshStamped(mesh, stamp_s, "camera"));
    EXPECT_EQ(lost.status, deformable_ccd::ContactArray::NO_TRANSFORM);
    EXPECT_FALSE(lost.answered);
  }
  EXPECT_TRUE(waitUntil([&] { return !clear.last().data; }));
  tf.publish(transformAt(100.6, "camera", {0, 0, 0}));
  EXPECT_EQ(send(publisher, meshStamped(mesh, 100.4, "camera")).status, deformable_ccd::ContactArray::PARTIAL)
      << "from the last good frame on, over two that were not used";
  EXPECT_EQ(send(publisher, meshStamped(mesh, 100.5, "camera")).status, deformable_ccd::ContactArray::OK);
  expectAddsUp();
}

struct Mapped : MonitorTest {
  Mapped() : MonitorTest("/mapped") {}
};

TEST_F(Mapped, AMapThatIsTooLargeIsRefusedUnreadAndCounted) {
  const auto mesh = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/mapped/mesh");
  const auto map = advertiseAndWait<octomap_msgs::Octomap>(node, "/mapped/octomap", true);
  double stamp_s = 50;
  const auto becomes = [&](std::uint8_t status) {
    return waitUntil([&] { return send(mesh, meshStamped(sheetAt(3), stamp_s += 0.01)).status == status; });
  };
  octomap_msgs::Octomap good = blockBelowZero(true, 50), large = good;
  large.data.resize(2 << 20);
  map.publish(good);
  ASSERT_TRUE(becomes(deformable_ccd::ContactArray::OK));
  const Stats before = stats.last();
  map.publish(large);
  ASSERT_TRUE(becomes(deformable_ccd::ContactArray::NO_MAP));
  EXPECT_NE(contacts.last().reason.find("max_map_mb"), std::string::npos) << contacts.last().reason;
  ASSERT_TRUE(waitUntil([&] { return stats.last().maps_refused == before.maps_refused + 1; }));
  EXPECT_EQ(stats.last().maps_received, before.maps_received + 1);
  map.publish(good);
  ASSERT_TRUE(becomes(deformable_ccd::ContactArray::OK));
  const auto refused = trigger("record_step");
  EXPECT_FALSE(refused.success);
  EXPECT_NE(refused.message.find("record_steps is 0"), std::string::npos) << refused.message;
  expectAddsUp();
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "faults_test"); }
