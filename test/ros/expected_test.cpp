// Expected contacts through the live node: no alarm in their phase, but found, listed, counted, marked and said.
#include <deformable_ccd/FirstContact.h>
#include <deformable_ccd/Named.h>
#include <deformable_ccd/PatchEvent.h>
#include <deformable_ccd/State.h>

#include "ros/support/effects.h"
#include "ros/support/live_tests.h"
#include "ros/support/monitor_fixture.h"

namespace dccd {
namespace test {
namespace {

using deformable_ccd::ContactArray;
using deformable_ccd::State;

struct Pressing : MonitorTest {
  Pressing() : MonitorTest("/pressing") {}
  ros::Publisher mesh = advertiseAndWait<deformable_ccd::MeshStamped>(node, name_ + "/mesh");
  Probe<State> state{node, name_ + "/state"};
  Probe<deformable_ccd::FirstContact> first{node, name_ + "/first_contact"};

  deformable_ccd::Named::Response setPhase(const std::string& phase) {
    deformable_ccd::Named call;
    call.request.name = phase;
    EXPECT_TRUE(ros::service::call(name_ + "/set_phase", call));
    return call.response;
  }
  /// What ~state said first of the step with this end; later it says that no more frames come.
  bool saidAt(const ros::Time& end) {
    for (const State& one : state.all()) {
      if (one.holds_until != end) continue;
      said = one;
      return true;
    }
    return false;
  }
  State said;

  /// The tip from one height to another one, after a reset.
  ContactArray move(double from_z, double to_z, double stamp_s) {
    EXPECT_TRUE(trigger("reset").success);
    send(mesh, meshStamped(tipAbove(from_z), stamp_s));
    const ContactArray outcome = send(mesh, meshStamped(tipAbove(to_z), stamp_s + 0.1));
    const ros::Time end(stamp_s + 0.1);
    EXPECT_TRUE(waitUntil([&] { return saidAt(end); }));
    EXPECT_TRUE(waitUntil([&] { return first.count() > 0 && first.last().header.stamp == end; }));
    EXPECT_TRUE(waitUntil([&] { return stats.count() > 0 && stats.last().header.stamp == end; }));
    return outcome;
  }
};

// The first case of this monitor: nobody has listened to its predictions.
TEST_F(Pressing, NoEffectIsOnThatNobodyListensTo) {
  Probe<diagnostic_msgs::DiagnosticArray> effects(node, "/pressing/effects");
  const auto lookAhead = [&] { return effectIn(effects.last(), "look_ahead"); };
  ASSERT_TRUE(waitUntil([&] { return effects.count() > 0; }));
  EXPECT_FALSE(lookAhead().running);
  EXPECT_EQ(lookAhead().reason, "nobody subscribes to predictions");
  {
    Probe<deformable_ccd::FirstContact> prediction(node, "/pressing/time_to_contact");
    EXPECT_TRUE(waitUntil([&] { return lookAhead().running; })) << lookAhead().reason;
  }
  EXPECT_TRUE(waitUntil([&] { return !lookAhead().running; })) << "the subscriber has gone";
}

TEST_F(Pressing, InItsPhaseItIsFoundListedCountedMarkedAndNoAlarm) {
  const auto reply = setPhase("press");
  EXPECT_TRUE(reply.success);
  const std::string words = "mesh ('tip', 1 vertices) with mesh ('table', 3 vertices) in phase 'press'";
  EXPECT_EQ(reply.message, "from the next step on: phase 'press', expected: " + words);
  const ContactArray outcome = move(0.1, -0.01, 200);  // after ~reset, over which the phase stays
  ASSERT_EQ(outcome.status, ContactArray::OK) << outcome.reason;
  ASSERT_EQ(outcome.contacts.size(), 1u);
  EXPECT_TRUE(outcome.contacts[0].expected);
  EXPECT_EQ(outcome.expected_contacts, 1u);
  EXPECT_EQ(stats.last().contacts_expected, 1u);
  EXPECT_TRUE(said.proved) << said.reason;
  EXPECT_EQ(said.touching, State::EXPECTED);
  EXPECT_FALSE(said.clear) << "an expected contact is a contact";
  EXPECT_EQ(said.expected, std::vector<std::string>{words});
  EXPECT_NE(said.reason.find("what touches is expected"), std::string::npos) << said.reason;
  EXPECT_FALSE(first.last().contact);
  EXPECT_EQ(first.last().expected_contacts, 1u);
  move(0.1, 0.08, 210);
  EXPECT_EQ(said.touching, State::NONE);
  EXPECT_EQ(said.expected, std::vector<std::string>{words}) << "said also where nothing touches";
  EXPECT_TRUE(said.clear);
}

TEST_F(Pressing, APhaseThatEndsIsAnAlarmForWhatGoesOnTouching) {
  Probe<deformable_ccd::PatchEvent> events(node, "/pressing/events");
  Probe<deformable_ccd::FirstContact> prediction(node, "/pressing/time_to_contact");
  EXPECT_TRUE(setPhase("carry").success);
  move(0.1, -0.01, 220);
  EXPECT_EQ(said.touching, State::EXPECTED) << said.reason;
  const auto stay = [&](double stamp_s) {  // the tip stays below the table: edges cross, and there is no contact
    EXPECT_EQ(send(mesh, meshStamped(tipAbove(-0.01), stamp_s)).contacts.size(), 0u);
    EXPECT_TRUE(waitUntil([&] { return saidAt(ros::Time(stamp_s)); }));
    EXPECT_TRUE(waitUntil([&] { return first.last().header.stamp == ros::Time(stamp_s); }));
    return first.last();
  };
  EXPECT_FALSE(stay(220.2).contact);
  EXPECT_TRUE(setPhase("").success);
  const auto alarm = stay(220.3);
  EXPECT_TRUE(alarm.contact);
  EXPECT_EQ(alarm.seconds, 0);
  EXPECT_EQ(alarm.time_of_contact, ros::Time(220.2));
  EXPECT_NE(alarm.summary.find("surfaces cross since before the step began"), std::string::npos) << alarm.summary;
  EXPECT_EQ(said.touching, State::NEW) << said.reason;
  EXPECT_TRUE(said.proved) << said.reason;
  EXPECT_FALSE(stay(220.4).contact) << "one alarm";
  EXPECT_EQ(said.touching, State::LASTING);
  std::size_t unexpected = 0;
  for (const auto& event : events.all()) unexpected += event.kind == deformable_ccd::PatchEvent::UNEXPECTED;
  EXPECT_EQ(unexpected, 1u);
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "expected_test"); }
