// What a launch argument or a parameter names is called for: a named map that does not come, or that is refused, is
// NO_MAP, at WARN in diagnostics and never clear. What nobody named is not missed.
#include "ros/support/bytes_of.h"
#include "ros/support/effects.h"
#include "ros/support/live_tests.h"
#include "ros/support/monitor_fixture.h"

#include <algorithm>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <topic_tools/shape_shifter.h>

namespace dccd {
namespace test {
namespace {

using deformable_ccd::ContactArray;
using diagnostic_msgs::DiagnosticStatus;

struct Inputs : MonitorTest {
  explicit Inputs(const std::string& name) : MonitorTest(name) {}
  Probe<diagnostic_msgs::DiagnosticArray> diagnostics{node, "/diagnostics"};
  ros::Publisher mesh = advertiseAndWait<deformable_ccd::MeshStamped>(node, name_ + "/mesh");
  double stamp_s = 10;

  /// The next step, far above any map.
  ContactArray step() { return send(mesh, meshStamped(sheetAt(3), stamp_s += 0.1)); }
  ContactArray stepUntil(std::uint8_t status) {
    waitUntil([&] { return step().status == status; });
    return contacts.last();
  }
  /// The monitor's newest diagnosis.
  DiagnosticStatus diagnosis() const {
    const auto all = diagnostics.all();
    for (auto array = all.rbegin(); array != all.rend(); ++array) {
      for (const DiagnosticStatus& status : array->status) {
        if (status.name == name_ + ": steps") return status;
      }
    }
    return {};
  }
  /// Steps until a diagnosis holds the text.
  DiagnosticStatus diagnosisWith(const std::string& text) {
    waitUntil(
        [&] {
          step();
          return diagnosis().message.find(text) != std::string::npos;
        },
        15);
    return diagnosis();
  }
  std::string octomapsReason() {
    Probe<diagnostic_msgs::DiagnosticArray> effects(node, name_ + "/effects");
    return effectIn(effects.after(0), "octomap").reason;
  }

  void expectNoMap(const std::string& topic) {
    stepUntil(ContactArray::NO_MAP);
    const ContactArray outcome = step();
    EXPECT_EQ(outcome.status, ContactArray::NO_MAP) << outcome.reason;
    EXPECT_TRUE(outcome.answered) << "about the mesh";
    EXPECT_TRUE(waitUntil([&] { return clear.count() > 2; }));
    const auto said = clear.all();
    EXPECT_TRUE(std::none_of(said.begin(), said.end(), [](const std_msgs::Bool& one) { return one.data; }));
    const DiagnosticStatus diagnosed = diagnosisWith("NO_MAP");
    EXPECT_EQ(diagnosed.level, DiagnosticStatus::WARN) << diagnosed.message;
    EXPECT_NE(diagnosed.message.find(topic), std::string::npos) << diagnosed.message;
  }
};

/// The same bytes under another name of the type. What differs in more than the name does not even connect: a
/// subscription that has taken one type keeps to it.
topic_tools::ShapeShifter forked(const octomap_msgs::Octomap& map) {
  std::vector<std::uint8_t> bytes = bytesOf(map);
  ros::serialization::IStream in(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  topic_tools::ShapeShifter message;
  namespace traits = ros::message_traits;
  message.morph(traits::md5sum(map), "forked_msgs/Octomap", traits::definition(map), "1");
  message.read(in);
  return message;
}

struct Named : Inputs {
  Named() : Inputs("/named") {}
};

// The first case of this monitor: it has not had any map.
TEST_F(Named, AMapThatNobodyPublishesIsMissedFromTheFirstStepOn) {
  EXPECT_EQ(octomapsReason(), "octomap_topic names /named/map, from which no map has come");
  step();
  EXPECT_EQ(step().status, ContactArray::NO_MAP);
  expectNoMap("/named/map");
  const auto map = advertiseAndWait<octomap_msgs::Octomap>(node, "/named/map", true);
  map.publish(blockBelowZero(true));
  EXPECT_EQ(stepUntil(ContactArray::OK).status, ContactArray::OK);
  EXPECT_EQ(octomapsReason(), "the map comes from /named/map");
}

TEST_F(Named, AMapThatIsRefusedByItsTypeIsNotTheOneBefore) {
  {
    const auto map = advertiseAndWait<octomap_msgs::Octomap>(node, "/named/map", true);
    map.publish(blockBelowZero(true));
    ASSERT_EQ(stepUntil(ContactArray::OK).status, ContactArray::OK);
    ASSERT_TRUE(waitUntil([&] { return step().status == ContactArray::OK && stats.last().map_present; }));
  }
  const std::uint64_t received = stats.last().maps_received, refused = stats.last().maps_refused;
  {
    topic_tools::ShapeShifter another = forked(blockBelowZero(true));
    const ros::Publisher map = another.advertise(node, "/named/map", 1, true);
    map.publish(another);
    const ContactArray outcome = stepUntil(ContactArray::NO_MAP);
    EXPECT_EQ(outcome.status, ContactArray::NO_MAP) << "the newest message is no map, and the older one is out of date";
    EXPECT_NE(outcome.reason.find("type forked_msgs/Octomap is not an octomap"), std::string::npos) << outcome.reason;
  }
  EXPECT_TRUE(waitUntil([&] { return stats.last().maps_refused > refused; }));
  EXPECT_EQ(stats.last().maps_received, received + 1);
  EXPECT_EQ(stats.last().maps_refused, refused + 1);
  const auto map = advertiseAndWait<octomap_msgs::Octomap>(node, "/named/map", true);
  map.publish(blockBelowZero(true));
  EXPECT_EQ(stepUntil(ContactArray::OK).status, ContactArray::OK) << "and a good one heals it";
}

struct Misspelt : Inputs {
  Misspelt() : Inputs("/misspelt") {}
};

TEST_F(Misspelt, TheMapThatIsThereUnderAnotherNameIsPointedAt) {
  expectNoMap("/misspelt/octomap_binray");
  const std::string hint = "an octomap is published on /misspelt/octomap_binary";
  const DiagnosticStatus diagnosed = diagnosisWith(hint);
  EXPECT_NE(diagnosed.message.find(hint), std::string::npos) << diagnosed.message;
  EXPECT_NE(diagnosed.message.find("octomap:=TOPIC"), std::string::npos) << diagnosed.message;
}

struct Remapped : Inputs {
  Remapped() : Inputs("/remapped") {}
};

TEST_F(Remapped, ARemappingOfTheDefaultNamesAMap) {
  expectNoMap("/remapped/map");
  const auto map = advertiseAndWait<octomap_msgs::Octomap>(node, "/remapped/map", true);
  map.publish(blockBelowZero(true));
  EXPECT_EQ(stepUntil(ContactArray::OK).status, ContactArray::OK);
}

struct Guessed : Inputs {
  Guessed() : Inputs("/guessed") {}
};

TEST_F(Guessed, ARemappingOfOctomapIsTakenAtItsWord) {
  expectNoMap("/guessed/map");
  const auto map = advertiseAndWait<octomap_msgs::Octomap>(node, "/guessed/map", true);
  map.publish(blockBelowZero(true));
  EXPECT_EQ(stepUntil(ContactArray::OK).status, ContactArray::OK);
  EXPECT_TRUE(waitUntil([&] { return step().status == ContactArray::OK && stats.last().map_present; }));
}

struct Unnamed : Inputs {
  Unnamed() : Inputs("/unnamed") {}
};

TEST_F(Unnamed, ADefaultNamesNothing) {
  EXPECT_EQ(stepUntil(ContactArray::OK).status, ContactArray::OK) << contacts.last().reason;
  EXPECT_TRUE(waitUntil([&] { return clear.last().data; })) << "nobody called for a map";
  EXPECT_EQ(octomapsReason(), "nobody publishes /octomap_binary and no octomap_file is given");
}

/// There from the start, as the other monitors see, too: with frames coming the master is asked ever more rarely.
class MisspeltMap : public ::testing::Environment {
  void SetUp() override {
    map_ = ros::NodeHandle().advertise<octomap_msgs::Octomap>("/misspelt/octomap_binary", 1, true);
  }
  void TearDown() override { map_.shutdown(); }
  ros::Publisher map_;
};

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) {
  testing::AddGlobalTestEnvironment(new dccd::test::MisspeltMap);
  return dccd::test::runLiveTests(argc, argv, "inputs_test");
}
