// The hash of a configuration: another one for other values, whatever they were read from, and for live changes.
#include <gtest/gtest.h>

#include <functional>
#include <iterator>
#include <set>

#include "unit/ros/parameter_support.h"

namespace dccd {
namespace test {
namespace {

TEST(Parameters, TheHashTellsConfigurationsApart) {
  XmlRpcValue tree;
  tree["max_step_s"] = 0.25;
  const MonitorConfig config = readConfig(tree);
  EXPECT_NE(config.hash(), readConfig(XmlRpcValue()).hash());
  EXPECT_EQ(config.hash(), readConfig(tree).hash());
  tree["live"]["max_step_s"] = 0.3;
  EXPECT_EQ(readConfig(tree).hash(), config.hash()) << "what an earlier node wrote back is not in force";
}

TEST(Parameters, TheHashTellsLiveValuesApart) {
  const MonitorConfig given = readConfig(XmlRpcValue());
  const std::function<void(MonitorConfig&)> changes[] = {
      [](MonitorConfig& c) { c.monitor.detector.accuracy.rung = Accuracy::CONSERVATIVE; },
      [](MonitorConfig& c) { c.monitor.detector.step_budget_ms = 5; },
      [](MonitorConfig& c) { c.monitor.store.max_step_s = 0.25; },
      [](MonitorConfig& c) { c.monitor.store.max_vertex_step_m = 0.25; },
      [](MonitorConfig& c) { c.monitor.detector.max_contacts = 5; },
      [](MonitorConfig& c) { c.markers.point_size_m = 0.02; },
      [](MonitorConfig& c) { c.markers.mesh = true; },
      [](MonitorConfig& c) { c.markers.obstacle_m = 0.02; },
  };
  std::set<std::uint64_t> seen{given.hash()};
  for (const auto& change : changes) {
    MonitorConfig live = given;
    change(live);
    seen.insert(live.hash());
  }
  EXPECT_EQ(seen.size(), std::size(changes) + 1);
}

TEST(Parameters, TheHashIsThatOfTheValuesWhereverTheyWereRead) {
  XmlRpcValue tree;
  tree["max_step_s"] = 0.25;
  tree["exclude_boxes"][0][0] = 0;
  for (int i = 1; i < 6; ++i) tree["exclude_boxes"][0][i] = 1.5;
  const std::string text = "exclude_boxes: [[0, 1.5, 1.5, 1.5, 1.5, 1.5]]\nmax_step_s: 0.25\n";
  EXPECT_EQ(readConfig(parseYaml(text, "p.yaml"), "").hash(), readConfig(tree).hash());
  EXPECT_NE(readConfig(parseYaml("max_step_s: 0.5\n", "p.yaml"), "").hash(), readConfig(tree).hash());
}

}  // namespace
}  // namespace test
}  // namespace dccd
