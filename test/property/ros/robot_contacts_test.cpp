// The panda moves its joints at random through a random cloth: each contact that the monitor reports, and each that it
// does not, by the rational oracle. Along straight paths, and along arcs in several parts. DEFORMABLE_CCD_LONG=1 takes
// many more steps.
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

/// Between which two of its ends and waypoints a body is, and how far between them.
struct Leg {
  Waypoint from, to;
  double u = 0;
  Leg(const Body& body, double at) : from{0, body.pose_t0, body.t0}, to{1, body.pose_t1, body.t1} {
    for (const Waypoint& point : body.waypoints) {
      if (point.u < at) from = point;
      if (point.u >= at && point.u < to.u) to = point;
    }
    u = (at - from.u) / (to.u - from.u);
  }
};

/// In the order of their times, straight steps: where the monitor has the bodies at both ends of each part.
std::vector<Step> partsOf(const Step& step, std::size_t parts) {
  std::vector<Step> all;
  Step at = step;
  for (Body& body : at.bodies) body.t1 = body.t0;
  for (std::size_t i = 1; i <= parts; ++i) {
    const double u = static_cast<double>(i) / static_cast<double>(parts);
    for (std::size_t b = 0; b < at.bodies.size(); ++b) {
      const Body& body = step.bodies[b];
      Positions end;
      interpolate(*body.t0, *body.t1, u, end);
      if (body.turns && i < parts) {
        const Leg leg(body, u);
        const Eigen::Isometry3d moved = interpolate(leg.from.pose, leg.to.pose, leg.u) * body.pose_t0.inverse();
        for (std::size_t v = 0; v < end.size(); ++v) end[v] = moved * (*body.t0)[v];
      }
      at.bodies[b].t0 = at.bodies[b].t1;
      at.bodies[b].t1 = share(std::move(end));
    }
    all.push_back(at);
  }
  return all;
}

/// How far the body is at the end of a part from where slerp has it, and how far its straight way through that part is
/// from the arc [m]; half way it is furthest.
std::pair<double, double> offArc(const Step& step, const Step& part, std::size_t body, double from, double to) {
  const Body &whole = step.bodies[body], &straight = part.bodies[body];
  const auto onArc = [&](double u, const Vec3& p) -> Vec3 {
    const Leg leg(whole, u);
    const Eigen::Quaterniond a(leg.from.pose.linear()), b(leg.to.pose.linear()), start(whole.pose_t0.linear());
    const Vec3 origin = (1 - leg.u) * leg.from.pose.translation() + leg.u * leg.to.pose.translation();
    return origin + a.slerp(leg.u, b) * (start.conjugate() * (p - whole.pose_t0.translation()));
  };
  double end_m = 0, middle_m = 0;
  for (std::size_t v = 0; v < whole.t0->size(); ++v) {
    const Vec3 &p = (*whole.t0)[v], &t0 = (*straight.t0)[v], &t1 = (*straight.t1)[v];
    end_m = std::max(end_m, (onArc(to, p) - t1).norm());
    middle_m = std::max(middle_m, (onArc((from + to) / 2, p) - (t0 + t1) / 2).norm());
  }
  return {end_m, middle_m};
}

/// The panda's joints and a cloth, at random.
class RobotContacts : public ::testing::Test {
 protected:
  void SetUp() override {
    DEFORMABLE_CCD_REQUIRE_DATA();
    if (!Panda::isThere()) GTEST_SKIP() << "no panda in " << dataDir();
    panda_.emplace();
    joints_.resize(panda_->joints());
  }

  void start(double rigid_tolerance_m) {
    XmlRpc::XmlRpcValue tree = scene();
    tree["fixed_frame"] = "panda_link0";
    tree["topology"]["rows"] = tree["topology"]["cols"] = SIDE;
    tree["effects"]["octomap"] = "off";
    tree["robot"]["description"] = "robot_description";
    tree["rigid_tolerance_m"] = rigid_tolerance_m;
    driven_.emplace(tree, [&](const RobotConfig& config, double tolerance_m) {
      return robotFrom(panda_->urdf(), "", config, tolerance_m);
    });
    ASSERT_EQ(driven_->config.bodies.size(), 12u);
  }

  /// Each joint by up to so much [rad, m]; now and then the cloth goes to another link, from where it drifts and
  /// crumples.
  void move(int frame, double joint) {
    const double stamp_s = 1 + 0.1 * frame;
    for (double& one : joints_) one = std::clamp(one + joint * unit_(random_), -2.5, 2.5);
    const Panda::Placed placed = panda_->place(joints_, stamp_s);
    driven_->feed_tf.add(placed.tf, false);
    const KDL::Vector link = std::next(placed.from_base.begin(), frame / 10 % placed.from_base.size())->second.p;
    const Vec3 drift = any(0.01), center = Vec3(link.x(), link.y(), link.z()) + any(0.2);
    for (int i = 0; i < SIDE * SIDE; ++i) {
      Vec3& p = cloth_[static_cast<std::size_t>(i)];
      const Vec3 flat(0.06 * (i % SIDE - SIDE / 2), 0.06 * (i / SIDE - SIDE / 2), 0);
      p = frame % 10 == 0 ? Vec3(center + flat + any(0.01)) : Vec3(p + drift + any(0.005));
    }
    driven_->pipeline.take(0, {"sensor_msgs/PointCloud2", gridAt(stamp_s, cloth_), 0, 0});
    ASSERT_TRUE(driven_->pipeline.nextOutcome(0, driven_->outcome));
  }

  /// Of all parts of the step: a contact is that of the first part that has it.
  void judge(const std::vector<Step>& parts) {
    const Outcome& outcome = driven_->outcome;
    struct InPart {
      TrueContact truth;
      std::size_t part;
    };
    std::vector<InPart> expected;
    std::size_t start = 0;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      Truth truth = truthOf(parts[i]);
      if (i == 0) start = truth.start;
      for (TrueContact& contact : truth.contacts) expected.push_back({std::move(contact), i});
    }
    const auto less = [](const InPart& a, const InPart& b) { return canonicalLess(a.truth.contact, b.truth.contact); };
    std::stable_sort(expected.begin(), expected.end(), less);
    const auto same = [&](const InPart& a, const InPart& b) { return !less(a, b) && !less(b, a); };
    expected.erase(std::unique(expected.begin(), expected.end(), same), expected.end());
    ASSERT_EQ(outcome.start_state, start == 0 ? StartState::CLEAR : StartState::INTERSECTING);
    ASSERT_EQ(outcome.contacts.size(), expected.size());
    const int bits = driven_->config.monitor.detector.accuracy.toc_bits;
    const double count = static_cast<double>(parts.size());
    for (std::size_t c = 0; c < expected.size(); ++c) {
      const Contact &found = outcome.contacts[c], &truth = expected[c].truth.contact;
      ASSERT_EQ(std::tie(found.kind, found.body, found.vertex), std::tie(truth.kind, truth.body, truth.vertex))
          << describe(found) << " instead of " << describe(truth);
      ASSERT_EQ(found.certainty, Certainty::CERTAIN);
      // The part's cell, from which the whole step's is rounded outward.
      const double part = static_cast<double>(expected[c].part);
      ElementaryResult cell;
      for (const auto& [mine, its] :
           {std::pair(&cell.toc_lower, found.toc_lower), std::pair(&cell.toc_upper, found.toc_upper)}) {
        *mine = std::ldexp(std::round(std::ldexp(its * count - part, bits)), -bits);
        ASSERT_NEAR((part + *mine) / count, its, 1e-15);
      }
      ASSERT_LE(found.toc_lower * count, part + cell.toc_lower);
      ASSERT_GE(found.toc_upper * count, part + cell.toc_upper);
      ASSERT_TRUE(isCellOf(expected[c].truth.toc, cell, bits)) << describe(found);
      touching_ += found.body[0] != found.body[1];
      later_ += expected[c].part > 0;
    }
    contacts_ += expected.size();
    crossing_ += start > 0;
  }

  Vec3 any(double size) { return {size * unit_(random_), size * unit_(random_), size * unit_(random_)}; }

  std::optional<Panda> panda_;
  std::optional<Driven> driven_;
  std::mt19937_64 random_{11};
  std::uniform_real_distribution<double> unit_{-1, 1};
  std::vector<double> joints_;
  Positions cloth_{SIDE * SIDE};
  std::size_t contacts_ = 0, touching_ = 0, later_ = 0, crossing_ = 0;
};

TEST_F(RobotContacts, NoneOfThePandasIsMissedOrInventedAndTimesAreInTheirCells) {
  start(10);                                  // straight paths
  const int steps = longRun() ? 10000 : 110;  // ten with each link
  for (int frame = 0; frame <= steps && !HasFatalFailure(); ++frame) {
    SCOPED_TRACE("frame " + std::to_string(frame));
    move(frame, 0.02);
    if (frame == 0) continue;
    ASSERT_EQ(driven_->outcome.status, StepStatus::OK) << driven_->outcome.reason;
    ASSERT_EQ(driven_->outcome.substeps, 1u);
    judge({*driven_->outcome.step});
  }
  std::cout << steps << " steps, " << contacts_ << " contacts, " << touching_ << " of them with links; " << crossing_
            << " steps began crossing\n";
  EXPECT_GT(touching_, static_cast<std::size_t>(steps));
  EXPECT_LT(crossing_, static_cast<std::size_t>(steps));
}

TEST_F(RobotContacts, NorOfLinksThatTurnInAStepOfSeveralParts) {
  constexpr double TOLERANCE_M = 2e-4;
  start(TOLERANCE_M);
  const int steps = longRun() ? 3000 : 33;
  std::size_t in_parts = 0;
  double end_m = 0, middle_m = 0;
  for (int frame = 0; frame <= steps && !HasFatalFailure(); ++frame) {
    SCOPED_TRACE("frame " + std::to_string(frame));
    move(frame, 0.1);
    if (frame == 0) continue;
    const Outcome& outcome = driven_->outcome;
    ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
    const std::vector<Step> parts = partsOf(*outcome.step, outcome.substeps);
    judge(parts);
    // Links that are all far touch nothing on their arcs either.
    const bool all_far = outcome.substeps == 1 && outcome.stats.bodies_far + 1 >= outcome.step->bodies.size();
    const std::size_t finer = outcome.substeps > 1 ? outcome.substeps : 8;
    const std::vector<Step> arcs = partsOf(*outcome.step, finer);
    for (std::size_t i = 0; i < finer; ++i) {
      const auto at = [&](std::size_t part) { return static_cast<double>(part) / static_cast<double>(finer); };
      for (std::size_t b = 1; b < outcome.step->bodies.size(); ++b) {
        const auto off = offArc(*outcome.step, arcs[i], b, at(i), at(i + 1));
        end_m = std::max(end_m, off.first);
        const bool touches = std::any_of(outcome.contacts.begin(), outcome.contacts.end(),
                                         [&](const Contact& contact) { return contact.body[1] == b; });
        if (touches && outcome.substeps > 1)
          middle_m = std::max(middle_m, off.second);  // far ones may leave their arcs
      }
      if (!all_far) continue;
      for (const TrueContact& contact : truthOf(arcs[i]).contacts) ASSERT_EQ(contact.contact.body[1], 0);
    }
    in_parts += outcome.substeps > 1;
  }
  std::cout << steps << " steps, " << in_parts << " of them in parts, " << contacts_ << " contacts, " << touching_
            << " of them with links, " << later_ << " after the first part; " << crossing_ << " steps began crossing\n";
  EXPECT_LT(end_m, 1e-12);
  EXPECT_GT(end_m, 0) << "two computations";
  EXPECT_LE(middle_m, TOLERANCE_M);
  EXPECT_GT(middle_m, TOLERANCE_M / 10);
  EXPECT_GT(in_parts, static_cast<std::size_t>(steps) / 3);
  EXPECT_GT(later_, static_cast<std::size_t>(steps));
  EXPECT_LT(crossing_, static_cast<std::size_t>(steps));
}

}  // namespace
}  // namespace test
}  // namespace dccd
