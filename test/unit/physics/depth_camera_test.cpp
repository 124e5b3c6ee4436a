// What a scene's camera sees, against geometry that is looked up point by point along each ray.
#include "scenes/physics/depth_camera.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "scenes/physics/scene_file.h"
#include "scenes/physics/shapes.h"

namespace dccd::scene {
namespace {

constexpr double FLOAT_M = 2e-6;  // of a coordinate in float32 within ten metres

/// A camera at (1, -2, 1.5) that looks at the origin.
SceneSpec sceneOf(const std::string& solids, const std::string& camera_more = "",
                  const std::string& body = "sheet: {rows: 5, cols: 5, size_m: [0.4, 0.4], center_m: [0, 0, -50]}") {
  return parseScene(
      "name: seen\ndescription: A camera looks on\nframes: 2\nphysics: {}\nbodies:\n  - name: body\n"
      "    output: point_cloud_grid\n    mass_kg: 0.1\n    thickness_m: 0.03\n    " +
          body + "\nobstacle:\n  resolution_m: 0.05\n  solids:\n    " + solids +
          "\ncamera: {position_m: [1, -2, 1.5], looks_at_m: [0, 0, 0], width: 48, height: 36, "
          "field_of_view_rad: 0.4, rate_hz: 5" +
          camera_more + "}\n",
      "seen");
}

const char* const BOX = "- box: {min_m: [-0.3, -0.2, -0.25], max_m: [0.4, 0.3, 0.1]}";
const char* const FAR_BOX = "- box: {min_m: [-9, -9, 90], max_m: [9, 9, 99]}";

SceneState startOf(const SceneSpec& spec) {
  SceneState state;
  for (const Body& body : spec.bodies) state.bodies.push_back(startPositions(body.shape));
  for (const RigidBody& body : spec.rigid_bodies) {
    state.rigid_bodies.push_back(Eigen::Isometry3d(Eigen::Translation3d(body.start_m)));
  }
  return state;
}

bool isSeen(const Eigen::Vector3f& point) { return point.allFinite(); }

/// The way of a pixel's ray, in the fixed frame, from the definition of a pinhole camera.
Vec3 directionOf(const Camera& camera, std::size_t pixel) {
  const double focal_px = 24 / std::tan(0.2);
  const Vec3 way(static_cast<double>(pixel % 48) - 23.5, static_cast<double>(pixel / 48) - 17.5, focal_px);
  return camera.pose.linear() * way.normalized();
}

/// Walks along each ray in steps of 2 mm: what is seen lies at the first place that is inside, to a step.
void expectFirstInside(const SceneSpec& spec, const std::vector<Eigen::Vector3f>& cloud,
                       const std::function<bool(const Vec3&)>& inside) {
  constexpr double STEP_M = 0.002;
  ASSERT_EQ(cloud.size(), 48u * 36u);
  int seen = 0, unseen = 0;
  for (std::size_t pixel = 0; pixel < cloud.size(); ++pixel) {
    const Vec3 from = spec.camera->pose.translation(), way = directionOf(*spec.camera, pixel);
    double first_m = 0;
    while (first_m < 4 && !inside(from + first_m * way)) first_m += STEP_M;
    ++(isSeen(cloud[pixel]) ? seen : unseen);
    if (!isSeen(cloud[pixel])) {
      EXPECT_GE(first_m, 4) << "pixel " << pixel;
      continue;
    }
    const Vec3 point = spec.camera->pose * cloud[pixel].cast<double>();
    EXPECT_LT((point - from).cross(way).norm(), FLOAT_M) << "off its ray, pixel " << pixel;
    // A ray that only grazes may be inside between two steps alone.
    if (first_m < 4) {
      EXPECT_LE((point - from).norm(), first_m + FLOAT_M) << "pixel " << pixel;
      EXPECT_GE((point - from).norm(), first_m - 0.02) << "pixel " << pixel;
    }
    EXPECT_TRUE(inside(point + 1e-5 * way) || first_m >= 4) << "before the surface, pixel " << pixel;
    EXPECT_FALSE(inside(point - 1e-5 * way)) << "behind the surface, pixel " << pixel;
  }
  EXPECT_GT(seen, 50);
  EXPECT_GT(unseen, 50);
}

TEST(DepthCamera, ABoxIsSeenOnItsSides) {
  const SceneSpec spec = sceneOf(BOX);
  const Solid box = spec.obstacle->solids[0];
  const auto cloud = DepthCamera(spec).look(startOf(spec));
  expectFirstInside(spec, cloud, [&](const Vec3& p) { return contains(box, p); });
  for (const Eigen::Vector3f& p : cloud) {
    if (!isSeen(p)) continue;
    const Vec3 point = spec.camera->pose * p.cast<double>();
    const double off =
        std::min((point - box.box.min).cwiseAbs().minCoeff(), (point - box.box.max).cwiseAbs().minCoeff());
    EXPECT_LT(off, FLOAT_M) << point.transpose();
  }
}

TEST(DepthCamera, SolidsAreSmallerByTheInset) {
  const SceneSpec spec = sceneOf(BOX, ", inset_m: 0.05");
  Solid inner = spec.obstacle->solids[0];
  inner.box.min += Vec3(0.05, 0.05, 0.05);
  inner.box.max -= Vec3(0.05, 0.05, 0.05);
  expectFirstInside(spec, DepthCamera(spec).look(startOf(spec)), [&](const Vec3& p) { return contains(inner, p); });
}

TEST(DepthCamera, ARingIsSeenAndWhatLiesBehindItsHole) {
  const SceneSpec spec = sceneOf("- ring: {center_m: [0, 0, 0], axis: [1, 2, 0], radius_m: 0.3, tube_radius_m: 0.06}");
  const Solid ring = spec.obstacle->solids[0];
  expectFirstInside(spec, DepthCamera(spec).look(startOf(spec)), [&](const Vec3& p) { return contains(ring, p); });
}

TEST(DepthCamera, ARopeIsAsThickAsPhysicsTakesIt) {
  const SceneSpec spec = sceneOf(FAR_BOX, "", "rope: {points: 9, length_m: 0.8, center_m: [0, 0, 0]}");
  SceneState state = startOf(spec);
  state.bodies[0][4] += Vec3(0.0, 0.2, 0.1);
  const Positions& points = state.bodies[0];
  expectFirstInside(spec, DepthCamera(spec).look(state), [&](const Vec3& p) {
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
      const Vec3 way = points[i + 1] - points[i];
      const double along = std::clamp((p - points[i]).dot(way) / way.squaredNorm(), 0.0, 1.0);
      if ((p - points[i] - along * way).norm() <= 0.03) return true;
    }
    return false;
  });
}

TEST(DepthCamera, ARigidBodyIsSeenWhereItIs) {
  SceneSpec spec = sceneOf(FAR_BOX);
  spec.rigid_bodies.push_back({"finger", "finger", Vec3(0.5, 0.3, 0.2), Vec3::Zero(), {}});
  SceneState state = startOf(spec);
  state.rigid_bodies[0].translate(Vec3(0.1, 0.0, 0.0));
  state.rigid_bodies[0].rotate(Eigen::AngleAxisd(0.7, Vec3(1, 1, 0).normalized()));
  expectFirstInside(spec, DepthCamera(spec).look(state), [&](const Vec3& p) {
    const Vec3 local = state.rigid_bodies[0].inverse() * p;
    return (local.cwiseAbs().array() <= Vec3(0.25, 0.15, 0.1).array()).all();
  });
}

TEST(DepthCamera, ALinkIsSeenWhereItIs) {
  SceneSpec spec = sceneOf(FAR_BOX);
  spec.robot.emplace();
  // A tetrahedron: the origin, and 0.4 m along each axis.
  const Positions corners{{0, 0, 0}, {0.4, 0, 0}, {0, 0.4, 0}, {0, 0, 0.4}};
  spec.robot->links.emplace_back().surfaces.push_back({corners, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}});
  SceneState state = startOf(spec);
  state.links.emplace_back(Eigen::Translation3d(0.1, 0, -0.1));
  state.links[0].rotate(Eigen::AngleAxisd(0.7, Vec3(1, 1, 0).normalized()));
  expectFirstInside(spec, DepthCamera(spec).look(state), [&](const Vec3& p) {
    const Vec3 local = state.links[0].inverse() * p;
    return local.minCoeff() >= 0 && local.sum() <= 0.4;
  });
}

TEST(DepthCamera, NothingIsSeenBehindACloth) {
  // The cloth hangs across the way to the box, and hides the middle of it.
  const SceneSpec spec = sceneOf(
      BOX, "", "sheet: {rows: 9, cols: 9, size_m: [0.3, 0.3], center_m: [0.5, -1, 0.75], rotation_rad: [1, 0, 0]}");
  const auto cloud = DepthCamera(spec).look(startOf(spec));
  const Eigen::AngleAxisd turn(1.0, Vec3::UnitX());
  const Vec3 from = spec.camera->pose.translation(), normal = turn * Vec3::UnitZ(), center(0.5, -1, 0.75);
  int on_cloth = 0, on_box = 0;
  for (std::size_t pixel = 0; pixel < cloud.size(); ++pixel) {
    const Vec3 way = directionOf(*spec.camera, pixel);
    const double range = (center - from).dot(normal) / way.dot(normal);
    const Vec3 local = turn.inverse() * (from + range * way - center);
    const double outside = std::max(std::abs(local[0]), std::abs(local[1])) - 0.15;
    if (std::abs(outside) < 1e-9) continue;
    if (outside < 0) {
      ASSERT_TRUE(isSeen(cloud[pixel])) << "between two faces, pixel " << pixel;
      EXPECT_NEAR(cloud[pixel].norm(), range, FLOAT_M);
      ++on_cloth;
    } else if (isSeen(cloud[pixel])) {
      EXPECT_GT(cloud[pixel].norm(), range) << "pixel " << pixel;
      ++on_box;
    }
  }
  EXPECT_GT(on_cloth, 100);
  EXPECT_GT(on_box, 50);
}

TEST(DepthCamera, AFaceThatReachesBehindTheCameraIsSeenBeforeIt) {
  const SceneSpec spec = sceneOf(FAR_BOX, "", "sheet: {rows: 2, cols: 2, size_m: [40, 40], center_m: [0, 0, 0]}");
  int seen = 0;
  for (const Eigen::Vector3f& p : DepthCamera(spec).look(startOf(spec))) {
    if (!isSeen(p)) continue;
    EXPECT_NEAR((spec.camera->pose * p.cast<double>())[2], 0.0, FLOAT_M);
    ++seen;
  }
  EXPECT_EQ(seen, 48 * 36) << "the camera looks down at it everywhere";
  const SceneSpec above = sceneOf(FAR_BOX, "", "sheet: {rows: 2, cols: 2, size_m: [40, 40], center_m: [0, 0, 3]}");
  for (const Eigen::Vector3f& p : DepthCamera(above).look(startOf(above))) EXPECT_FALSE(isSeen(p)) << "behind it";
}

TEST(DepthCamera, SeesTheSolidsAloneWhereThereIsNothingElse) {
  const SceneSpec spec = sceneOf(BOX, "", "sheet: {rows: 2, cols: 2, size_m: [40, 40], center_m: [0, 0, 0.5]}");
  const Solid box = spec.obstacle->solids[0];
  expectFirstInside(spec, DepthCamera(spec).look(SceneState{}), [&](const Vec3& p) { return contains(box, p); });
}

TEST(DepthCamera, NoiseLiesAlongTheRayAndIsAsLargeAsItSays) {
  const SceneSpec still = sceneOf(BOX), spec = sceneOf(BOX, ", noise_m: 0.004");
  DepthCamera camera(spec);
  const auto truth = DepthCamera(still).look(startOf(still));
  double sum = 0, squares = 0;
  int count = 0;
  for (int look = 0; look < 20; ++look) {
    const auto cloud = camera.look(startOf(spec));
    for (std::size_t pixel = 0; pixel < cloud.size(); ++pixel) {
      ASSERT_EQ(isSeen(cloud[pixel]), isSeen(truth[pixel]));
      if (!isSeen(cloud[pixel])) continue;
      const double off = cloud[pixel].norm() - truth[pixel].norm();
      EXPECT_LT((cloud[pixel].normalized() - truth[pixel].normalized()).norm(), 1e-6);
      sum += off;
      squares += off * off;
      ++count;
    }
  }
  ASSERT_GT(count, 5000);
  // Five standard errors of a mean and of a standard deviation.
  EXPECT_NEAR(sum / count, 0.0, 5 * 0.004 / std::sqrt(count));
  EXPECT_NEAR(std::sqrt(squares / count), 0.004, 5 * 0.004 / std::sqrt(2.0 * count));
}

TEST(DepthCamera, TheShareOfPixelsThatItSaysIsLost) {
  const SceneSpec spec =
      sceneOf(FAR_BOX, ", lost_share: 0.3", "sheet: {rows: 2, cols: 2, size_m: [40, 40], center_m: [0, 0, 0]}");
  DepthCamera camera(spec);
  int seen = 0;
  for (int look = 0; look < 10; ++look) {
    for (const Eigen::Vector3f& p : camera.look(startOf(spec))) seen += isSeen(p);
  }
  const double count = 480 * 36;
  EXPECT_NEAR(seen / count, 0.7, 5 * std::sqrt(0.3 * 0.7 / count));
}

TEST(DepthCamera, PixelsFlyBetweenWhatIsInFrontAndBehind) {
  const std::string solids = std::string(BOX) + "\n    - box: {min_m: [-9, -9, -1], max_m: [9, 9, -0.5]}";
  const SceneSpec still = sceneOf(solids), flying = sceneOf(solids, ", flying_share: 0.002");
  const auto clean = DepthCamera(still).look(startOf(still));
  DepthCamera camera(flying);
  int moved = 0;
  for (int look = 0; look < 50; ++look) {
    const auto cloud = camera.look(startOf(flying));
    for (std::size_t pixel = 0; pixel < cloud.size(); ++pixel) {
      if (cloud[pixel] == clean[pixel]) continue;
      ++moved;
      ASSERT_GT(pixel % 48, 0u);
      const float range = cloud[pixel].norm(), own = clean[pixel].norm(), left = clean[pixel - 1].norm();
      EXPECT_GT(std::abs(own - left), 0.05f);
      EXPECT_GE(range, std::min(own, left) - 1e-6f);
      EXPECT_LE(range, std::max(own, left) + 1e-6f);
    }
  }
  // Now and then two take the same place.
  EXPECT_LE(moved, 50 * 0.002 * 48 * 36 + 50);
  EXPECT_GE(moved, 0.9 * 50 * 0.002 * 48 * 36);
}

}  // namespace
}  // namespace dccd::scene
