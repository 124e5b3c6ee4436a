// The monitor beside a publisher in the same process: of a named type nothing is serialised or copied.
#include <deformable_ccd/ContactArray.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <nodelet/loader.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <boost/make_shared.hpp>

#include <algorithm>
#include <atomic>
#include <random>

#include "input/mesh_subscription.h"
#include "ros/support/bytes_of.h"
#include "ros/support/live_tests.h"
#include "ros/support/meshes.h"
#include "ros/support/monitor_fixture.h"
#include "ros/support/probe.h"

namespace dccd {
namespace test {
namespace {

boost::shared_ptr<const deformable_ccd::MeshStamped> shared(const Mesh& mesh, double stamp_s) {
  return boost::make_shared<const deformable_ccd::MeshStamped>(meshStamped(mesh, stamp_s));
}

/// A subscription on a callback queue that the test serves itself.
struct Subscription : ::testing::Test {
  ros::NodeHandle node;
  ros::CallbackQueue callbacks;
  std::vector<MeshMessage> received;
  std::uint64_t came = 0;
  bool throws = false;

  std::unique_ptr<MeshSubscription> subscribe(const std::string& topic, const std::string& type) {
    ros::NodeHandle handle(node);
    handle.setCallbackQueue(&callbacks);
    return std::make_unique<MeshSubscription>(
        handle, topic, findMeshTypeNamed(type), [this](std::uint64_t number) { came = number; },
        [this](MeshMessage m) {
          if (throws) throw std::bad_alloc();
          received.push_back(std::move(m));
        });
  }
  bool serveUntil(std::size_t count) {
    return waitUntil([&] {
      callbacks.callAvailable(ros::WallDuration(0.01));
      return received.size() >= count;
    });
  }
  const deformable_ccd::MeshStamped* address(std::size_t i) const {
    return received[i].object.as<deformable_ccd::MeshStamped>();
  }
};

TEST_F(Subscription, ToANamedTypeObjectsArriveFromTheSameProcess) {
  const auto subscription = subscribe("/near/mesh", "mesh_stamped");
  const ros::Publisher publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/near/mesh");
  std::vector<boost::shared_ptr<const deformable_ccd::MeshStamped>> sent;
  for (int i = 0; i < 5; ++i) {
    sent.push_back(shared(tipAbove(1), 10 + i));
    publisher.publish(sent.back());
    ASSERT_TRUE(serveUntil(sent.size()));
  }
  ASSERT_EQ(received.size(), sent.size());
  for (std::size_t i = 0; i < sent.size(); ++i) {
    EXPECT_EQ(address(i), sent[i].get()) << "message " << i;
    EXPECT_EQ(received[i].sender, ros::this_node::getName());
    EXPECT_EQ(received[i].number, i + 1);
  }
}

// Its number is told before anything of it is taken: whoever counts knows that one is missing.
TEST_F(Subscription, OfAMessageThatIsLostTheNumberIsTold) {
  for (const char* type : {"mesh_stamped", "auto"}) {
    const std::string topic = std::string("/lost/") + type;
    const auto subscription = subscribe(topic, type);
    const ros::Publisher publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, topic);
    for (const std::uint64_t number : {1, 2, 3}) {
      throws = number == 2;
      const std::size_t before = received.size();
      publisher.publish(shared(tipAbove(1), 10 + static_cast<double>(number)));
      ASSERT_TRUE(waitUntil([&] {
        callbacks.callAvailable(ros::WallDuration(0.01));
        return came == number;
      }));
      EXPECT_EQ(subscription->came(), number);
      ASSERT_EQ(received.size(), before + (throws ? 0 : 1));
      if (!throws) EXPECT_EQ(received.back().number, number);
    }
    came = 0;
  }
}

/// What roscpp does with the bytes of another process.
TEST_F(Subscription, OfDamagedBytesNoObjectIsMadeAndTheLossIsCounted) {
  const MeshType& type = *findMeshTypeNamed("mesh_stamped");
  const auto lost = std::make_shared<std::atomic<std::uint64_t>>(0);
  const auto receiver = type.receiver(type, lost, [](const TypedMesh&) {});
  std::vector<std::uint8_t> bytes = bytesOf(*shared(tipAbove(1), 10));
  ros::SubscriptionCallbackHelperDeserializeParams params;
  params.buffer = bytes.data();
  params.length = static_cast<std::uint32_t>(bytes.size());
  params.connection_header = boost::make_shared<ros::M_string>();
  EXPECT_NE(receiver->deserialize(params), nullptr);
  EXPECT_EQ(*lost, 0u);
  const std::size_t count_at = 4 + 8 + 4 + std::string("world").size();
  bytes[count_at + 3] = 0x7f;  // of vertices: 2^31, for which a generated reader would ask for 51 GB
  EXPECT_THROW(receiver->deserialize(params), WireError);
  EXPECT_EQ(*lost, 1u);
}

TEST_F(Subscription, ToAnyTypeOpensAnewWhenThePublisherIsGone) {
  const auto subscription = subscribe("/change/mesh", "auto");
  {
    const ros::Publisher publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/change/mesh");
    publisher.publish(shared(tipAbove(1), 10));
    ASSERT_TRUE(serveUntil(1));
    subscription->wantsRenewal();  // counts
  }
  ASSERT_TRUE(waitUntil([&] {
    const bool wants = subscription->wantsRenewal();
    if (wants) subscription->renew({});
    return wants && subscription->getNumPublishers() == 0;
  }));
  const ros::Publisher publisher = advertiseAndWait<sensor_msgs::PointCloud2>(node, "/change/mesh");
  publisher.publish(boost::make_shared<const sensor_msgs::PointCloud2>(cloud(gridAt(2, 2, 0), 50)));
  ASSERT_TRUE(serveUntil(2));
  EXPECT_EQ(received[1].datatype, "sensor_msgs/PointCloud2");
}

TEST(Nodelet, FindsTheSameContactsWithoutSerialising) {
  nodelet::Loader loader;
  nodelet::M_string remappings{{"/mesh", "/nodelet/mesh"}};
  ros::param::set("/inside/fixed_frame", "world");
  ros::param::set("/inside/max_vertex_step_m", 10.0);
  ros::param::set("/inside/type", "mesh_stamped");
  ASSERT_TRUE(loader.load("/inside", "deformable_ccd/CollisionMonitor", remappings, {}));

  ros::NodeHandle node;
  Probe<deformable_ccd::ContactArray> contacts(node, "/inside/contacts");
  Probe<diagnostic_msgs::DiagnosticArray> diagnostics(node, "/diagnostics");
  const ros::Publisher publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/nodelet/mesh");
  constexpr int FRAMES = 10;
  for (int i = 0; i < FRAMES; ++i) {
    const std::size_t seen = contacts.count();
    publisher.publish(shared(tipAbove(i % 2 ? -3 : 1), 10 + 0.1 * i));
    const deformable_ccd::ContactArray outcome = contacts.after(seen);
    EXPECT_EQ(outcome.status, i == 0 ? deformable_ccd::ContactArray::FIRST_FRAME : deformable_ccd::ContactArray::OK)
        << outcome.reason;
    if (i % 2 == 1) {
      EXPECT_FALSE(outcome.contacts.empty()) << "down through the triangle";
    }
  }
  const auto handedOver = [&]() -> std::string {
    const auto array = diagnostics.last();
    for (const auto& status : array.status) {
      for (const auto& pair : status.values) {
        if (pair.key == "frames handed over in process") return pair.value;
      }
    }
    return "";
  };
  EXPECT_TRUE(waitUntil([&] { return handedOver() == std::to_string(FRAMES); }, 5)) << handedOver();
}

/// A grid that is crumpled so that a step has much to do.
sensor_msgs::PointCloud2ConstPtr crumpled(std::size_t side, double stamp_s) {
  std::mt19937 random(static_cast<std::uint32_t>(stamp_s * 100));
  std::uniform_real_distribution<double> noise(-0.2, 0.2);
  Positions positions = gridAt(side, side, 0);
  for (Vec3& p : positions) p += Vec3(noise(random), noise(random), noise(random));
  return boost::make_shared<const sensor_msgs::PointCloud2>(cloud(positions, stamp_s));
}

TEST(Nodelet, UnloadingEndsCallsThatWaitForTheWorker) {
  nodelet::Loader loader;
  constexpr int SIDE = 40, FRAMES = 100;
  ros::param::set("/busy/topology/rows", SIDE);
  ros::param::set("/busy/topology/cols", SIDE);
  ros::param::set("/busy/max_vertex_step_m", 0.0);
  ros::param::set("/busy/queue_size", FRAMES);
  ros::param::set("/busy/record_steps", 0);
  ASSERT_TRUE(loader.load("/busy", "deformable_ccd/CollisionMonitor", {{"/mesh", "/busy/mesh"}}, {}));
  ros::NodeHandle node;
  const ros::Publisher publisher = advertiseAndWait<sensor_msgs::PointCloud2>(node, "/busy/mesh");
  Probe<deformable_ccd::ContactArray> contacts(node, "/busy/contacts");
  // Far more than is done before the end, so that the worker takes no command but between two steps.
  for (int i = 0; i < FRAMES; ++i) publisher.publish(crumpled(SIDE, 10 + 0.1 * i));
  ASSERT_TRUE(waitUntil([&] { return contacts.count() >= 2; }, 60));
  std::vector<std::string> answers;
  std::atomic<bool> answered{false};
  std::thread caller([&] {
    std_srvs::Trigger call;
    while (ros::service::call("/busy/record_step", call)) {
      answers.push_back(call.response.message);
      answered = true;
    }
  });
  EXPECT_TRUE(waitUntil([&] { return answered.load(); }, 60));
  EXPECT_TRUE(loader.unload("/busy"));
  caller.join();
  EXPECT_LT(contacts.count(), static_cast<std::size_t>(FRAMES)) << "it was not busy";
  ASSERT_FALSE(answers.empty());
  EXPECT_EQ(answers.back(), "the monitor is being stopped") << "and not 10 s later that the worker is busy";
}

TEST(Nodelet, AWrongParameterIsRefusedByName) {
  nodelet::Loader loader;
  ros::param::set("/wrong/acuracy", "exact");
  EXPECT_FALSE(loader.load("/wrong", "deformable_ccd/CollisionMonitor", {}, {}));
  ros::param::del("/wrong");
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "nodelet_test"); }
