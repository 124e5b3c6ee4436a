// The panda moves its joints at random through a random cloth: each contact that the monitor reports, and each that it
// does not, by the rational oracle. DEFORMABLE_CCD_LONG=1 takes many more steps.
#include <gtest/gtest.h>

#include <algorithm>
#include <iostream>
#include <random>

#include "support/query_property.h"
#include "support/step_truth.h"
#include "unit/ros/pipeline/driven_pipeline.h"
#include "unit/ros/robot/panda.h"
#include "unit/ros/robot/robot_texts.h"

namespace dccd {
namespace test {
namespace {

constexpr int SIDE = 4;  // vertices of the cloth, each way

/// A grid of SIDE x SIDE points in float64.
std::vector<std::uint8_t> gridAt(double stamp_s, const Positions& positions) {
  sensor_msgs::PointCloud2 out;
  out.header.stamp = ros::Time(stamp_s);
  out.header.frame_id = "panda_link0";
  out.height = out.width = SIDE;
  for (const char* name : {"x", "y", "z"}) {
    sensor_msgs::PointField field;
    field.name = name;
    field.offset = static_cast<std::uint32_t>(8 * out.fields.size());
    field.datatype = sensor_msgs::PointField::FLOAT64;
    field.count = 1;
    out.fields.push_back(field);
  }
  out.point_step = sizeof(Vec3);
  out.row_step = SIDE * out.point_step;
  out.data.resize(positions.size() * sizeof(Vec3));
  std::memcpy(out.data.data(), positions.data(), out.data.size());
  return bytesOf(out);
}

Eigen::AlignedBox3d boundsOf(const Body& body, const std::vector<Index>& vertices) {
  Eigen::AlignedBox3d bounds;
  for (const Index v : vertices) {
    bounds.extend((*body.t0)[v]);
    bounds.extend((*body.t1)[v]);
  }
  return bounds;
}

/// With the faces alone that may meet what is in the box: a feature in it is one of these faces', or on one of them.
StepBody bodyOf(const Body& body, bool self_collision, const Eigen::AlignedBox3d& box) {
  std::vector<Face> faces;
  for (const Face& f : body.topology->faces()) {
    if (boundsOf(body, {f[0], f[1], f[2]}).intersects(box)) faces.push_back(f);
  }
  StepBody out;
  out.topology = Topology::fromTriangles(body.t0->size(), faces);
  out.t0 = *body.t0;
  out.t1 = *body.t1;
  out.self_collision = self_collision;
  return out;
}

struct Truth {
  std::vector<TrueContact> contacts;  // in canonical order
  std::size_t start = 0;              // pairs that meet at the start
};

/// Of the cloth with itself and with each link; links do not meet each other.
Truth truthOf(const Step& step) {
  Truth truth;
  const Eigen::AlignedBox3d all(Vec3::Constant(-1e9), Vec3::Constant(1e9));
  const auto boxOf = [&](std::size_t b) { return boundsOf(step.bodies[b], step.bodies[b].topology->usedVertices()); };
  const auto add = [&](const TestStep& near, const TestStep& whole, std::uint16_t link) {
    for (TrueContact& contact : trueContacts(near)) {
      for (std::uint16_t& body : contact.contact.body) body = body == 0 ? 0 : link;
      truth.contacts.push_back(contact);
    }
    truth.start += trueIntersections(near).size() + trueInsides(whole).size();
  };
  const TestStep cloth{{bodyOf(step.bodies[0], true, all)}};
  add(cloth, cloth, 0);
  for (std::size_t b = 1; b < step.bodies.size(); ++b) {
    if (!boxOf(0).intersects(boxOf(b))) continue;
    const auto pair = [&](const Eigen::AlignedBox3d& of_link, const Eigen::AlignedBox3d& of_cloth) {
      return TestStep{{bodyOf(step.bodies[0], false, of_link), bodyOf(step.bodies[b], false, of_cloth)}};
    };
    add(pair(boxOf(b), boxOf(0)), pair(all, all), static_cast<std::uint16_t>(b));
  }
  std::sort(truth.contacts.begin(), truth.contacts.end(),
            [](const TrueContact& a, const TrueContact& b) { return canonicalLess(a.contact, b.contact); });
  return truth;
}

TEST(RobotContacts, NoneOfThePandasIsMissedOrInventedAndTimesAreInTheirCells) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  if (!Panda::isThere()) GTEST_SKIP() << "no panda in " << dataDir();
  const Panda panda;
  XmlRpcValue tree = scene();
  tree["fixed_frame"] = "panda_link0";
  tree["topology"]["rows"] = tree["topology"]["cols"] = SIDE;
  tree["effects"]["octomap"] = "off";
  tree["robot"]["description"] = "robot_description";
  tree["rigid_tolerance_m"] = 10.0;  // straight paths, which the oracle has
  Driven driven(tree, [&](const RobotConfig& config, double tolerance_m) {
    return robotFrom(panda.urdf(), "", config, tolerance_m);
  });
  ASSERT_EQ(driven.config.bodies.size(), 12u);
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto any = [&](double size) { return Vec3(size * unit(random), size * unit(random), size * unit(random)); };
  std::vector<double> joints(panda.joints());
  Positions cloth(SIDE * SIDE);
  const int steps = longRun() ? 10000 : 110;  // ten with each link
  std::size_t contacts = 0, touching = 0, crossing = 0;
  for (int frame = 0; frame <= steps; ++frame) {
    const double stamp_s = 1 + 0.1 * frame;
    for (double& joint : joints) joint = std::clamp(joint + 0.02 * unit(random), -2.5, 2.5);
    const Panda::Placed placed = panda.place(joints, stamp_s);
    driven.feed_tf.add(placed.tf, false);
    // Now and then to another link; from there it drifts and crumples.
    const KDL::Vector link = std::next(placed.from_base.begin(), frame / 10 % placed.from_base.size())->second.p;
    const Vec3 drift = any(0.01), center = Vec3(link.x(), link.y(), link.z()) + any(0.2);
    for (int i = 0; i < SIDE * SIDE; ++i) {
      const Vec3 flat(0.06 * (i % SIDE - SIDE / 2), 0.06 * (i / SIDE - SIDE / 2), 0);
      cloth[static_cast<std::size_t>(i)] = frame % 10 == 0
                                               ? Vec3(center + flat + any(0.01))
                                               : Vec3(cloth[static_cast<std::size_t>(i)] + drift + any(0.005));
    }
    driven.pipeline.take(0, {"sensor_msgs/PointCloud2", gridAt(stamp_s, cloth), 0, 0});
    Outcome& outcome = driven.outcome;
    ASSERT_TRUE(driven.pipeline.nextOutcome(0, outcome));
    if (frame == 0) continue;
    ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
    ASSERT_EQ(outcome.substeps, 1u);
    Truth truth = truthOf(*outcome.step);
    ASSERT_EQ(outcome.start_state, truth.start == 0 ? StartState::CLEAR : StartState::INTERSECTING)
        << "frame " << frame;
    ASSERT_EQ(outcome.contacts.size(), truth.contacts.size()) << "frame " << frame;
    for (std::size_t i = 0; i < truth.contacts.size(); ++i) {
      const Contact &found = outcome.contacts[i], &expected = truth.contacts[i].contact;
      ASSERT_EQ(std::tie(found.kind, found.body, found.vertex), std::tie(expected.kind, expected.body, expected.vertex))
          << "frame " << frame << ": " << describe(found) << " instead of " << describe(expected);
      ASSERT_EQ(found.certainty, Certainty::CERTAIN);
      ElementaryResult cell;
      cell.toc_lower = found.toc_lower;
      cell.toc_upper = found.toc_upper;
      ASSERT_TRUE(isCellOf(truth.contacts[i].toc, cell, driven.config.monitor.detector.accuracy.toc_bits))
          << "frame " << frame << ": " << describe(found);
      touching += found.body[0] != found.body[1];
    }
    contacts += truth.contacts.size();
    crossing += truth.start > 0;
  }
  std::cout << steps << " steps, " << contacts << " contacts, " << touching << " of them with links; " << crossing
            << " steps began crossing\n";
  EXPECT_GT(touching, static_cast<std::size_t>(steps));
  EXPECT_LT(crossing, static_cast<std::size_t>(steps));
}

}  // namespace
}  // namespace test
}  // namespace dccd
