// A long list of contacts is made for those who listen, and takes no time where nobody does.
#include <deformable_ccd/ContactArray.h>

#include <ctime>

#include <gtest/gtest.h>
#include <ros/ros.h>

#include "output/outputs.h"
#include "ros/support/probe.h"
#include "support/detector.h"

namespace dccd {
namespace test {
namespace {

constexpr std::size_t MANY = 100000;

/// Of this thread [ms]: what else the machine does is not counted.
double processorMs() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

/// A vertex falls through a face, listed again and again.
Outcome manyContacts() {
  Body body;
  body.name = "cloth";
  body.topology = share(Topology::fromTriangles(6, {{0, 1, 2}, {3, 4, 5}}));
  const Positions t0{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.2, 0.2, 1}, {0.3, 0.2, 2}, {0.2, 0.3, 2}};
  Positions t1 = t0;
  t1[3].z() = -1;
  Outcome outcome = Detector().run(stepOf(body, t0, t1));
  const std::vector<Contact> found = outcome.contacts;
  outcome.contacts.assign(MANY, found.at(0));
  return outcome;
}

TEST(Lists, AreMadeForThoseWhoListenAlone) {
  const Outcome outcome = manyContacts();
  const std::vector<Body>& bodies = outcome.step->bodies;
  ros::NodeHandle node, lists("/lists");
  Outputs outputs(lists, MonitorConfig());
  const auto publishMs = [&](int times) {
    const double begin_ms = processorMs();
    for (int i = 0; i < times; ++i) outputs.makeResult(outcome, bodies, "world")();
    return processorMs() - begin_ms;
  };
  publishMs(1);
  const double unheard_ms = publishMs(100);
  Probe<deformable_ccd::ContactArray> contacts(node, "/lists/contacts");
  double heard_ms = 0;
  ASSERT_TRUE(waitUntil([&] {
    heard_ms = publishMs(1);
    return contacts.count() > 0;
  }));
  EXPECT_EQ(contacts.last().contacts.size(), MANY);
  EXPECT_LT(unheard_ms, heard_ms) << "a hundred lists that nobody listens to against one";
}

}  // namespace
}  // namespace test
}  // namespace dccd
