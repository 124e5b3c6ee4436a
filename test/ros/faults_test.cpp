// What real systems do to a monitor: the right status within one step, recovery within two, counters that add up.
#include "ros/support/live_tests.h"
#include "ros/support/monitor_fixture.h"

namespace dccd {
namespace test {
namespace {

constexpr std::size_t MONITORS = 2;  // in faults.test; each listens to /tf

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

struct Watched : MonitorTest {
  Watched() : MonitorTest("/watched") {}
};

TEST_F(Watched, TfThatStopsAndComesBack) {
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/watched/mesh");
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
  EXPECT_EQ(trigger("record_step").message, "nothing is recorded: record_steps is 0");
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "faults_test"); }
