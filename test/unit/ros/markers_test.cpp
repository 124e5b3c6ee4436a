// How much of a step is drawn, and for how long it stands.
#include "output/markers.h"

#include <gtest/gtest.h>

namespace dccd {
namespace {

using visualization_msgs::Marker;

/// A triangle over a solid block of EDGE^3 voxels, all of which are near it, with `contacts` contacts.
Outcome overABlock(std::uint16_t edge, std::size_t contacts) {
  std::vector<OccupiedLeaf> leaves;
  constexpr std::uint16_t ORIGIN = 32768;
  for (std::uint16_t x = 0; x < edge; ++x) {
    for (std::uint16_t y = 0; y < edge; ++y) {
      for (std::uint16_t z = 0; z < edge; ++z) {
        OccupiedLeaf leaf;
        leaf.min.x = static_cast<std::uint16_t>(ORIGIN + x);
        leaf.min.y = static_cast<std::uint16_t>(ORIGIN + y);
        leaf.min.z = static_cast<std::uint16_t>(ORIGIN + z);
        leaves.push_back(leaf);
      }
    }
  }
  Outcome outcome;
  outcome.answered = true;
  outcome.status = StepStatus::OK;
  outcome.start_ns = 1'000'000'000;
  outcome.stamp_ns = 1'250'000'000;
  auto step = std::make_shared<Step>();
  step->bodies.resize(2);
  for (Body& body : step->bodies) {
    body.topology = share(Topology::fromTriangles(3, {{0, 1, 2}}));
    body.t0 = body.t1 = share(Positions{{0, 0, 1}, {1, 0, 1}, {0, 1, 1}});
  }
  outcome.step = step;
  outcome.obstacle = VoxelSurface::build(0.1, std::move(leaves));
  Contact contact;
  contact.body = {0, 1};
  contact.vertex = {0, 0, 1, 2};
  outcome.contacts.assign(contacts, contact);
  return outcome;
}

std::vector<Body> twoBodies() { return std::vector<Body>(2); }

std::size_t pointsIn(const visualization_msgs::MarkerArray& array, const std::string& ns) {
  std::size_t points = 0;
  for (const Marker& marker : array.markers) points += marker.ns == ns ? marker.points.size() : 0;
  return points;
}

TEST(Markers, TheShortestSegmentOfTwoPartnersIsRedWhenNearAndGreenWhenFar) {
  Outcome outcome = overABlock(1, 0);
  std::vector<Body> bodies = twoBodies();
  bodies[0].name = "cloth";
  bodies[1].name = "palm";
  const auto segment = [](std::uint16_t b, double length_m) {
    Clearance clearance;
    clearance.body = {0, b};
    clearance.at_end.status = ClearanceStatus::MEASURED;
    clearance.at_end.lower_m = clearance.at_end.upper_m = length_m;
    clearance.at_end.point = {Vec3(0, b, 1), Vec3(0, b, 1 + length_m)};
    return clearance;
  };
  Clearance farther;  // has no points
  farther.body = {1, OBSTACLE_BODY};
  farther.at_end.status = ClearanceStatus::FARTHER;
  Clearance expected = segment(1, 0.25);
  expected.expected = true;
  outcome.clearances = {segment(0, 0.05), segment(OBSTACLE_BODY, 0.2), farther, expected};
  MarkerConfig config;
  config.clearance_max_m = 0.2;
  std::vector<std::string> words;
  std::vector<std_msgs::ColorRGBA> colors;
  for (const Marker& marker : toMarkers(outcome, bodies, config, "world").markers) {
    if (marker.ns != "clearance") continue;
    if (marker.type == Marker::TEXT_VIEW_FACING) {
      words.push_back(marker.text);
    } else {
      ASSERT_EQ(marker.points.size(), 6u);
      EXPECT_EQ(marker.points[2].y, OBSTACLE_BODY);
      EXPECT_EQ(marker.points[3].z, 1.2);
      colors = marker.colors;
    }
  }
  EXPECT_EQ(words, (std::vector<std::string>{"cloth and itself 50.0 mm", "cloth and octomap 0.200 m",
                                             "cloth and palm 0.250 m"}));
  ASSERT_EQ(colors.size(), 6u);
  EXPECT_EQ(colors[0].r, 1);
  EXPECT_EQ(colors[0].g, 0.5f) << "a quarter of what is far";
  EXPECT_EQ(colors[2].r, 0);
  EXPECT_EQ(colors[2].g, 1);
  EXPECT_EQ(colors[4].r, 0.65f) << "expected ones are grey";
}

TEST(Markers, NoMoreVoxelsOfTheMapAreDrawnThanThePageSays) {
  MarkerConfig config;
  config.obstacle_m = 100;
  EXPECT_EQ(pointsIn(toMarkers(overABlock(20, 0), twoBodies(), config, "world"), "obstacle"), 20u * 20 * 20);
  EXPECT_EQ(pointsIn(toMarkers(overABlock(60, 0), twoBodies(), config, "world"), "obstacle"), 200000u);
}

TEST(Markers, NoMoreContactsAreDrawnThanAreAskedFor) {
  MarkerConfig config;
  EXPECT_EQ(pointsIn(toMarkers(overABlock(1, 5000), twoBodies(), config, "world"), "contacts"), 2000u);
  config.max_contacts = 7;
  EXPECT_EQ(pointsIn(toMarkers(overABlock(1, 5000), twoBodies(), config, "world"), "contacts"), 7u);
}

TEST(Markers, TheFaceThatIsTouchedIsThatOfItsBody) {
  Outcome outcome = overABlock(1, 1);
  Step step = *outcome.step;
  step.bodies[1].t0 = step.bodies[1].t1 = share(Positions{{7, 0, 1}, {8, 0, 1}, {7, 1, 1}});
  outcome.step = share(step);
  const visualization_msgs::MarkerArray drawn = toMarkers(outcome, twoBodies(), MarkerConfig(), "world");
  ASSERT_EQ(pointsIn(drawn, "faces"), 3u);
  for (const Marker& marker : drawn.markers) {
    if (marker.ns == "faces") EXPECT_EQ(marker.points[0].x, 7);
  }
}

/// So that nothing stays when the node is gone, and nothing goes while it lives.
TEST(Markers, AllLiveForASecondAndTwoSteps) {
  MarkerConfig config;
  config.obstacle_m = 100;
  config.mesh = true;
  const Outcome outcome = overABlock(2, 3);
  visualization_msgs::MarkerArray all = toMarkers(outcome, twoBodies(), config, "world");
  const visualization_msgs::MarkerArray predicted = toPredictedMarkers(outcome, 0.25, twoBodies(), config, "world");
  all.markers.insert(all.markers.end(), predicted.markers.begin(), predicted.markers.end());
  std::size_t drawn = 0;
  for (const Marker& marker : all.markers) {
    if (marker.action != Marker::ADD) continue;
    ++drawn;
    EXPECT_DOUBLE_EQ(marker.lifetime.toSec(), 1 + 2 * 0.25) << marker.ns;
  }
  EXPECT_GT(drawn, 5u);
}

}  // namespace
}  // namespace dccd
