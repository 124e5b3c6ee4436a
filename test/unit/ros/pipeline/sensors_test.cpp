// What cameras and lidars send, as they send it: depth pictures, several sensors, points that are no measurement,
// clouds that do not tell where their sensor was, and what has been seen too seldom.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <mutex>
#include <thread>

#include "unit/ros/pipeline/cloud_scene.h"

namespace dccd {
namespace test {
namespace {

constexpr std::uint32_t PIXELS = 64;  // a row, and rows
constexpr double FOCAL_PX = 64, CENTRE_PX = 31.5;

/// Depth [m] by column and row.
using Depth = std::function<float(std::uint32_t, std::uint32_t)>;

float tableDepth(std::uint32_t, std::uint32_t) { return 1; }

template <class Number>
void append(Number value, bool big_endian, std::vector<std::uint8_t>& data) {
  std::uint8_t bytes[sizeof(Number)];
  std::memcpy(bytes, &value, sizeof(Number));
  if (big_endian) std::reverse(bytes, bytes + sizeof(Number));
  data.insert(data.end(), bytes, bytes + sizeof(Number));
}

sensor_msgs::Image pictureOf(double stamp_s, const Depth& depth, const std::string& encoding = "32FC1",
                             bool big_endian = false, const std::string& frame = "camera") {
  sensor_msgs::Image out;
  out.header.stamp = ros::Time(stamp_s);
  out.header.frame_id = frame;
  out.width = out.height = PIXELS;
  out.encoding = encoding;
  out.is_bigendian = big_endian;
  out.step = PIXELS * (encoding == "16UC1" ? 2 : 4) + 4;  // rows may be longer than their pixels
  for (std::uint32_t row = 0; row < PIXELS; ++row) {
    for (std::uint32_t column = 0; column < PIXELS; ++column) {
      const float z = depth(column, row);
      if (encoding == "16UC1") append(static_cast<std::uint16_t>(std::lround(1000 * z)), big_endian, out.data);
      if (encoding != "16UC1") append(z, big_endian, out.data);
    }
    out.data.resize((row + 1) * out.step, 0xff);
  }
  return out;
}

std::array<float, 3> pointAt(std::uint32_t column, std::uint32_t row, float z) {
  return {static_cast<float>((column - CENTRE_PX) / FOCAL_PX) * z, static_cast<float>((row - CENTRE_PX) / FOCAL_PX) * z,
          z};
}

/// The same as points, row by row, or in no order.
sensor_msgs::PointCloud2 pointsOf(double stamp_s, const Depth& depth, bool is_organised = true,
                                  const std::string& frame = "camera") {
  std::vector<std::array<float, 3>> points;
  for (std::uint32_t row = 0; row < PIXELS; ++row) {
    for (std::uint32_t column = 0; column < PIXELS; ++column) {
      points.push_back(pointAt(column, row, depth(column, row)));
    }
  }
  sensor_msgs::PointCloud2 out = cloudOf(stamp_s, points, frame);
  if (!is_organised) return out;
  out.width = out.height = PIXELS;
  out.row_step = 12 * PIXELS;
  return out;
}

sensor_msgs::CameraInfo infoOf() {
  sensor_msgs::CameraInfo out;
  out.header.frame_id = "camera";
  out.width = out.height = PIXELS;
  out.distortion_model = "plumb_bob";
  out.D.assign(5, 0.0);
  out.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  out.K = {FOCAL_PX, 0, CENTRE_PX, 0, FOCAL_PX, CENTRE_PX, 0, 0, 1};
  out.P = {FOCAL_PX, 0, CENTRE_PX, 0, 0, FOCAL_PX, CENTRE_PX, 0, 0, 0, 1, 0};
  return out;
}

std::vector<std::uint64_t> keysOf(const VoxelSurface& surface) {
  std::vector<std::uint64_t> keys;
  for (const OccupiedLeaf& leaf : surface.leaves()) {
    keys.push_back(std::uint64_t{leaf.min.x} << 32 | std::uint64_t{leaf.min.y} << 16 | leaf.min.z);
    keys.push_back(leaf.size);
  }
  std::sort(keys.begin(), keys.end());
  return keys;
}

/// A scene with a camera whose pictures and clouds are taken.
struct Camera : Seen {
  explicit Camera(const std::string& more = "") : Seen(cloudScene(more)) {
    showCamera();
    clouds.setCameraInfo(0, "", bytesOf(infoOf()));
  }
  /// What stands in the way of a map; nothing where there is one.
  template <class Message>
  std::string whyNot(const Message& message, std::size_t source = 0, double seconds_later = 0) {
    const LoadedMap map = add(message, source, seconds_later);
    EXPECT_EQ(map.problem.empty(), map.surface != nullptr);
    return map.problem.empty() ? "" : whyRefused(map.problem, config);
  }
};

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }
::testing::AssertionResult says(const std::string& text, const std::string& part) {
  return (has(text, part) ? ::testing::AssertionSuccess() : ::testing::AssertionFailure()) << "\"" << text << "\"";
}

TEST(Sensors, ADepthPictureMakesTheMapThatItsPointsMake) {
  // A step in the table, so that depths are not all alike.
  const Depth depth = [](std::uint32_t column, std::uint32_t) { return column < 20 ? 0.875f : 1.0f; };
  const LoadedMap points = Camera().add(pointsOf(1, depth));
  ASSERT_TRUE(points.surface) << points.problem;
  EXPECT_GT(points.surface->leafCount(), 50u);
  for (const char* encoding : {"32FC1", "16UC1"}) {
    for (const bool big_endian : {false, true}) {
      const LoadedMap picture = Camera().add(pictureOf(1, depth, encoding, big_endian));
      ASSERT_TRUE(picture.surface) << picture.problem;
      EXPECT_EQ(keysOf(*picture.surface), keysOf(*points.surface)) << encoding << big_endian;
      EXPECT_EQ(picture.stamp_ns, 1'000'000'000);
    }
  }
}

// What it shows may be gone by then, and the newer one in the map has cleared it.
TEST(Sensors, AViewThatComesAfterALaterOneIsRefused) {
  Camera camera;
  EXPECT_EQ(camera.whyNot(pictureOf(5, tableDepth)), "");
  EXPECT_TRUE(says(camera.whyNot(pictureOf(4.5, tableDepth)),
                   "it is stamped 0.500000 s before one from there that is in the map"));
  EXPECT_EQ(camera.whyNot(pictureOf(5, tableDepth)), "") << "of one stamp";
  EXPECT_EQ(camera.whyNot(pictureOf(5.1, tableDepth)), "");
  EXPECT_EQ(camera.whyNot(pictureOf(1, tableDepth)), "") << "a time that begins anew";
}

TEST(Sensors, APictureThatCannotBeReadIsRefusedByName) {
  struct Case {
    sensor_msgs::Image picture;
    sensor_msgs::CameraInfo info;
    std::string expected;
  };
  const auto picture = [](const std::function<void(sensor_msgs::Image&)>& change) {
    sensor_msgs::Image one = pictureOf(1, tableDepth);
    change(one);
    return one;
  };
  const auto info = [](const std::function<void(sensor_msgs::CameraInfo&)>& change) {
    sensor_msgs::CameraInfo one = infoOf();
    one.header.stamp = ros::Time(1);  // the pictures' own
    change(one);
    return one;
  };
  const sensor_msgs::Image good = pictureOf(1, tableDepth);
  const Case cases[] = {
      {picture([](auto& p) { p.encoding = "rgb8"; }), infoOf(), "encoding 'rgb8' is no depth; 16UC1"},
      {picture([](auto& p) { p.data.resize(1000); }), infoOf(), "64 x 64 pixels of 32FC1 in rows of 260 bytes do not"},
      {picture([](auto& p) { p.step = 255; }), infoOf(), "in rows of 255 bytes do not fit"},
      {picture([](auto& p) { p.height = 0; }), infoOf(), "it has no pixels"},
      {good, info([](auto& i) { i.D[1] = -0.2; }), "D[1] is -0.2: pictures with distortion"},
      {good, info([](auto& i) { i.R[1] = 0.02; }), "R[1] is 0.02: pictures with distortion"},
      {good, info([](auto& i) { i.R[8] = 0; }), "R[8] is 0: pictures with distortion"},
      {good, info([](auto& i) { i.K[5] = 30; }), "K[5] is 30: pictures with distortion"},
      {good, info([](auto& i) { i.header.frame_id = "other"; }), "its frame_id is 'other', and the picture's 'camera'"},
      {good, info([](auto& i) { i.header.frame_id = ""; }), "its frame_id is '', and the picture's 'camera'"},
      {good, info([](auto& i) { i.P[0] = 0; }), "is no pinhole's projection"},
      {good, info([](auto& i) { i.P[3] = -20; }), "is no pinhole's projection"},
      {good, info([](auto& i) { i.binning_x = 2; }), "binning 2 x 0"},
      {good, info([](auto& i) { i.width = 128; }),
       "it has 64 x 64 pixels, and the CameraInfo on /camera/camera_info is of"},
  };
  for (const Case& one : cases) {
    Camera camera;
    camera.clouds.setCameraInfo(0, "", bytesOf(one.info));
    EXPECT_TRUE(says(camera.whyNot(one.picture), one.expected));
    EXPECT_TRUE(says(camera.whyNot(one.picture), "the cloud was refused: "));
  }
  XmlRpcValue rectified = cloudScene();
  rectified["obstacle_cloud_topic"] = "/camera/depth/image_rect_raw";
  Seen calibrated(rectified);
  calibrated.showCamera();
  calibrated.clouds.setCameraInfo(0, "", bytesOf(info([](auto& i) { i.D[1] = -0.2, i.R[1] = 0.02; })));
  EXPECT_EQ(calibrated.add(good).problem, "") << "the distortion is that of the picture before";
  Seen without;
  without.showCamera();
  EXPECT_TRUE(says(without.add(good).problem, "no CameraInfo has come on /camera/camera_info; name its topic"));
}

/// Of a camera that is zoomed in or out.
sensor_msgs::CameraInfo infoAt(double stamp_s, double focal_px = FOCAL_PX) {
  sensor_msgs::CameraInfo out = infoOf();
  out.header.stamp = ros::Time(stamp_s);
  out.P[0] = out.P[5] = out.K[0] = out.K[4] = focal_px;
  return out;
}

struct Zooming : Seen {
  Zooming() : Seen(cloudScene()) { showCamera(); }
  std::string hear(const sensor_msgs::CameraInfo& info) { return clouds.setCameraInfo(0, "", bytesOf(info)); }
  std::string whyNot(double stamp_s) { return add(pictureOf(stamp_s, tableDepth)).problem; }
};

// It was that of the CameraInfo that came last.
TEST(Sensors, APictureIsOfTheCameraInfoOfItsStamp) {
  const LoadedMap expected = Camera().add(pictureOf(1, tableDepth));
  for (const bool is_last : {false, true}) {
    Zooming camera;
    for (const bool is_own : {!is_last, is_last}) camera.hear(is_own ? infoAt(1) : infoAt(1.1, 640));
    const LoadedMap map = camera.add(pictureOf(1, tableDepth));
    ASSERT_TRUE(map.surface) << map.problem;
    EXPECT_EQ(keysOf(*map.surface), keysOf(*expected.surface)) << is_last;
    EXPECT_TRUE(says(camera.whyNot(1.05),
                     "no CameraInfo of its stamp has come on /camera/camera_info, and those around it differ"));
  }
  Zooming two;
  two.hear(infoAt(1));
  two.hear(infoAt(1, 640));
  EXPECT_TRUE(says(two.whyNot(1), "two CameraInfos of its stamp on /camera/camera_info differ"));
  Zooming steady;
  steady.hear(infoAt(1));
  steady.hear(infoAt(1.1));
  EXPECT_EQ(steady.whyNot(1.05), "") << "all say the same";
  two.hear(infoAt(1.2));
  EXPECT_EQ(two.whyNot(1.2), "") << "its own, whatever those before were";
}

TEST(Sensors, APictureWaitsForItsCameraInfoWhereThoseAroundItDiffer) {
  Zooming camera;
  camera.hear(infoAt(0.8));
  camera.hear(infoAt(0.9, 640));
  const LoadedMap map = camera.clouds.add(messageOf(pictureOf(1, tableDepth), 0, 1), [&] {
    camera.hear(infoAt(1));
    return true;
  });
  EXPECT_EQ(map.problem, "");
}

TEST(Sensors, ACameraInfoThatComesLaterAndIsAnotherOneIsTold) {
  Zooming camera;
  EXPECT_EQ(camera.hear(infoAt(1)), "");
  EXPECT_EQ(camera.whyNot(1), "");
  EXPECT_EQ(camera.whyNot(1.1), "");
  EXPECT_EQ(camera.hear(infoAt(1.1)), "") << "it says what those before said";
  EXPECT_EQ(camera.whyNot(1.2), "");
  EXPECT_TRUE(says(camera.hear(infoAt(1.2, 640)),
                   "the CameraInfo on /camera/camera_info of the picture at 1.200000000 s came after that was used"));
  EXPECT_NE(camera.hear(infoAt(1, 640)), "") << "two of one stamp";
  EXPECT_EQ(camera.hear(infoAt(1.3, 640)), "") << "of no picture that was used";
  sensor_msgs::CameraInfo bare = infoAt(0, 32);
  EXPECT_EQ(camera.hear(bare), "") << "of no stamp";
  Zooming renamed;
  renamed.hear(infoAt(1));
  EXPECT_EQ(renamed.whyNot(1.1), "");
  sensor_msgs::CameraInfo other = infoAt(1.1);
  other.header.frame_id = "other";
  EXPECT_NE(renamed.hear(other), "") << "of another frame";
}

TEST(Sensors, OfACutMessageNothingIsTaken) {
  const std::vector<std::uint8_t> picture = bytesOf(pictureOf(1, tableDepth)), info = bytesOf(infoOf());
  for (std::size_t size = 0; size < picture.size(); size += size < 80 ? 1 : 509) {
    Camera camera;
    CloudMessage cut = messageOf(sensor_msgs::Image(), 0, 1);
    cut.bytes.assign(picture.begin(), picture.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_NE(camera.clouds.add(cut, [] { return false; }).problem, "") << size;
  }
  for (std::size_t size = 0; size < info.size(); size += 7) {
    Camera camera;
    camera.clouds.setCameraInfo(0, "", {info.begin(), info.begin() + static_cast<std::ptrdiff_t>(size)});
    EXPECT_TRUE(says(camera.whyNot(pictureOf(1, tableDepth)), "the CameraInfo on /camera/camera_info: ")) << size;
  }
}

TEST(Sensors, TheCameraInfoIsBesideThePicturesOrWhereItIsNamed) {
  const CloudSource source{"/a/depth/image_rect_raw", "", ""}, named{"/a/depth/image", "/b/info", ""};
  EXPECT_EQ(cameraInfoTopic(source), "/a/depth/camera_info");
  EXPECT_EQ(cameraInfoTopic({"image", "", ""}), "camera_info");
  EXPECT_EQ(cameraInfoTopic(named), "/b/info");
}

// It was proved and clear, and one such point among good ones filled the camera's own voxel.
TEST(Sensors, PointsAtTheSensorAreNoMeasurement) {
  const Depth nothing = [](std::uint32_t, std::uint32_t) { return 0.0f; };
  const Depth block = [](std::uint32_t column, std::uint32_t row) { return column < 12 && row < 12 ? 0.0f : 1.0f; };
  for (const bool is_picture : {false, true}) {
    Camera camera;
    const auto why = [&](const Depth& depth) {
      return is_picture ? camera.whyNot(pictureOf(1, depth)) : camera.whyNot(pointsOf(1, depth));
    };
    EXPECT_TRUE(says(why(nothing),
                     "none of its 4096 points is a measurement: 4096 at the sensor, or nearer to it than "
                     "obstacle_min_range_m 0.01, 0 not finite"));
    EXPECT_EQ(camera.clouds.counters().no_measurement, 4096u);
    const LoadedMap map = is_picture ? camera.add(pictureOf(1, block)) : camera.add(pointsOf(1, block));
    ASSERT_TRUE(map.surface) << map.problem;
    EXPECT_EQ(camera.clouds.counters().no_measurement, 4096u + 144);
    EXPECT_LT(map.surface->bounds().max.z(), 0.2) << "nothing is where the camera is";
  }
  Camera far("obstacle_min_range_m: 1.3");
  EXPECT_TRUE(says(far.whyNot(pictureOf(1, tableDepth)), "nearer to it than obstacle_min_range_m 1.3"));
}

// Its rays went from the frame's origin, and cleared what nobody had looked through.
TEST(Sensors, ACloudInTheMapsOwnFrameTellsWhereItsSensorWas) {
  const auto inWorld = [](const std::string& more) {
    std::vector<std::array<float, 3>> points;
    for (std::uint32_t row = 0; row < PIXELS; ++row) {
      for (std::uint32_t column = 0; column < PIXELS; ++column) {
        const auto p = pointAt(column, row, 1);
        points.push_back({p[0], -p[1], 1.05f - p[2]});
      }
    }
    sensor_msgs::PointCloud2 out = cloudOf(1, points, "world");
    if (more.empty()) return out;
    addFields({"vp_x", "vp_y", "vp_z"}, out);
    out.point_step = 24;
    out.row_step = 24 * out.width;
    out.data.assign(out.row_step, 0);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const float place[3] = {0, more == "torn" ? 0.01f * static_cast<float>(i) : 0, 1.05f};
      std::memcpy(&out.data[24 * i], points[i].data(), 12);
      std::memcpy(&out.data[24 * i + 12], place, 12);
    }
    return out;
  };
  const LoadedMap own = Camera().add(pointsOf(1, tableDepth, false));
  ASSERT_TRUE(own.surface) << own.problem;
  Camera lost;
  EXPECT_TRUE(says(lost.whyNot(inWorld("")),
                   "the cloud was refused: it comes in the map's own frame 'world', which does not tell where the "
                   "sensor was, so that it fills and clears nothing; name the sensor's frame by sensor_frame"));
  EXPECT_EQ(lost.add(pointsOf(1, tableDepth, false)).surface, nullptr) << "that of another name was refused";
  EXPECT_TRUE(says(lost.whyNot(inWorld("torn")), "its points were seen from different places"));
  for (const bool by_fields : {false, true}) {
    Camera camera(by_fields ? "" : "obstacle_cloud_topics: [{topic: /points, sensor_frame: camera}]");
    const LoadedMap map = camera.add(inWorld(by_fields ? "whole" : ""));
    ASSERT_TRUE(map.surface) << map.problem;
    EXPECT_EQ(keysOf(*map.surface), keysOf(*own.surface)) << by_fields;
  }
}

TEST(Sensors, WhatIsSeenThroughFromTheNamedSensorIsCleared) {
  Camera camera("obstacle_cloud_topics: [{topic: /points, sensor_frame: camera}]");
  const auto inWorld = [](std::array<float, 3> p) { return cloudOf(1, {p}, "world"); };
  EXPECT_EQ(camera.add(inWorld({0.05f, 0.05f, 0.55f})).surface->leafCount(), 1u);
  for (int i = 0; i < 2; ++i) camera.add(inWorld({0.05f, 0.05f, 0.05f}));
  const LoadedMap map = camera.add(inWorld({0.05f, 0.05f, 0.05f}));
  ASSERT_TRUE(map.surface) << map.problem;
  EXPECT_EQ(map.surface->leafCount(), 1u);
  EXPECT_LT(map.surface->bounds().max.z(), 0.2);
}

TEST(Sensors, NoReturnIsAMapAndClearsIfSaid) {
  const Depth far = [](std::uint32_t, std::uint32_t) { return NO_RETURN; };
  for (const bool clears : {false, true}) {
    Camera camera(clears ? "obstacle_no_return: clears, obstacle_max_range_m: 2.0" : "");
    const std::size_t before = camera.add(pictureOf(1, tableDepth)).surface->leafCount();
    LoadedMap map;
    for (int i = 0; i < 4; ++i) map = camera.add(pictureOf(1, far));
    ASSERT_TRUE(map.surface) << "a picture of which nothing came back is one: " << map.problem;
    EXPECT_EQ(map.surface->leafCount(), clears ? 0 : before);
    EXPECT_EQ(map.hint, clears ? ""
                               : "the clouds on /camera/points have infinite points: nothing came back from there, and "
                                 "what was seen there before stays; obstacle_no_return: clears takes it away");
    camera.give(std::move(map));
    EXPECT_EQ(camera.pipeline.takeMapHint().empty(), clears);
    camera.give(camera.add(pictureOf(1, far)));
    EXPECT_EQ(camera.pipeline.takeMapHint(), "") << "it is said once";
    EXPECT_EQ(camera.feed(1, 0.35f).status, StepStatus::FIRST_FRAME);
    EXPECT_EQ(camera.feed(1.1, 0.35f).status, StepStatus::OK) << camera.outcome.reason;
  }
  Camera lidar("obstacle_no_return: clears");
  lidar.add(pointsOf(1, tableDepth, false));
  EXPECT_TRUE(says(lidar.add(cloudOf(1, {{0, 0, 1}, {NO_RETURN, NO_RETURN, NO_RETURN}})).hint,
                   "they are no pixels in rows, and nobody knows where these looked"));
}

// It was taken for 65.535 m, and cleared all that was nearer.
TEST(Sensors, TheLargestNumberOfAPictureIsNoMeasurement) {
  for (const bool big_endian : {false, true}) {
    const auto all = [&](float depth_m) {
      return pictureOf(
          1, [=](std::uint32_t, std::uint32_t) { return depth_m; }, "16UC1", big_endian);
    };
    Camera camera("obstacle_no_return: clears, obstacle_max_range_m: 2.0");
    const LoadedMap before = camera.add(pictureOf(1, tableDepth));
    ASSERT_TRUE(before.surface) << before.problem;
    const Depth left_lost = [](std::uint32_t column, std::uint32_t) { return column < 32 ? 65.535f : 1.0f; };
    LoadedMap map;
    for (int i = 0; i < 4; ++i) map = camera.add(pictureOf(1, left_lost, "16UC1", big_endian));
    ASSERT_TRUE(map.surface) << map.problem;
    EXPECT_EQ(keysOf(*map.surface), keysOf(*before.surface)) << "what was seen there before stays";
    EXPECT_TRUE(says(camera.whyNot(all(65.535f)), "none of its 4096 points is finite"));
    for (int i = 0; i < 20; ++i) map = camera.add(all(65.534f));
    ASSERT_TRUE(map.surface) << map.problem;
    EXPECT_EQ(map.surface->leafCount(), 0u) << "the next smaller one is a depth";
  }
}

TEST(Sensors, WhatLiesBeyondTheOctreeIsRefusedWithItsCure) {
  Camera camera;
  geometry_msgs::TransformStamped far = cameraPose(1);
  far.child_frame_id = "far";
  far.transform.translation.x = 456000;  // UTM
  camera.tell({far}, true);
  sensor_msgs::CameraInfo info = infoAt(1);
  info.header.frame_id = "far";
  camera.clouds.setCameraInfo(0, "", bytesOf(info));
  for (const std::string& why : {camera.whyNot(pictureOf(1, tableDepth, "32FC1", false, "far")),
                                 Camera().whyNot(cloudOf(1, {{0, 0, 1}, {0, 0, 5000}}))}) {
    EXPECT_TRUE(says(why, "the 65536 voxels of 0.1 m that a map can span"));
    EXPECT_TRUE(says(why, "the map is kept in frame 'world': set octomap_frame to one near the sensor"));
    EXPECT_FALSE(has(why, "max_map_mb")) << why;
  }
}

TEST(Sensors, WhatLiesOutsideOfTheBoxIsNotKept) {
  Camera camera("obstacle_box: [-1.0, -1.0, 0.2, 1.0, 1.0, 2.0]");
  const LoadedMap map = camera.add(pictureOf(1, tableDepth));
  ASSERT_TRUE(map.surface) << map.problem;
  EXPECT_EQ(map.surface->leafCount(), 0u);
  EXPECT_EQ(camera.add(cloudOf(1, {{0, 0, 0.6f}})).surface->leafCount(), 1u);
}

// With two on one topic most steps were proved while a box that one of them saw was not in the map.
TEST(Sensors, OfSeveralCamerasEachMustHaveItsPlaceInTheMap) {
  Camera camera(
      "obstacle_cloud_topics: [/left/points, {topic: /right/points, sensor_frame: right}], "
      "octomap_timeout_s: 1.0");
  camera.showCamera("right");
  const auto left = [&](double later = 0) { return camera.whyNot(cloudOf(1, {{0, 0, 0.8f}}), 0, later); };
  const auto right = [&](double later = 0) { return camera.whyNot(cloudOf(1, {{0.3f, 0, 0.8f}}, "right"), 1, later); };
  EXPECT_EQ(left(), "no cloud has come on /right/points yet");
  EXPECT_EQ(right(), "");
  EXPECT_EQ(left(), "");
  sensor_msgs::PointCloud2 flat = cloudOf(1, {{0.3f, 0, 0.8f}}, "right");
  flat.fields.pop_back();
  EXPECT_TRUE(says(camera.whyNot(flat, 1), "the cloud was refused: there is no field 'z'"));
  EXPECT_TRUE(says(left(), "the newest cloud 'right' on /right/points was refused: there is no field 'z'"));
  EXPECT_EQ(right(), "");
  EXPECT_TRUE(says(camera.whyNot(cloudOf(9, {{0, 0, 0.8f}}, "nowhere"), 1), "no transform from 'nowhere' to 'world'"));
  EXPECT_TRUE(says(left(), "no transform from 'nowhere' to 'world'")) << "another frame_id is another camera";
  EXPECT_TRUE(says(right(), "no transform from 'nowhere'")) << "also on the same topic";
  EXPECT_EQ(left(11), "no cloud 'right' on /right/points has come for longer than octomap_timeout_s")
      << "and 'nowhere' has not come for long enough to be forgotten";
  EXPECT_EQ(right(), "");
  EXPECT_EQ(left(), "");
}

// A camera that was renamed looks as one of two of which the other died: there is no map, and what helps is said.
TEST(Sensors, OneThatWasRenamedIsStillAwaitedAndThatIsSaid) {
  Camera camera("octomap_timeout_s: 1.0");
  camera.showCamera("new");
  EXPECT_EQ(camera.whyNot(cloudOf(1, {{0, 0, 0.8f}})), "");
  EXPECT_EQ(camera.whyNot(cloudOf(1, {{0, 0, 0.8f}}, "new"), 0, 0.5), "");
  const std::string why = camera.whyNot(cloudOf(1, {{0, 0, 0.8f}}, "new"), 0, 2);
  EXPECT_TRUE(says(why,
                   "has come for longer than octomap_timeout_s; if 'new' is that camera's new name, restart the "
                   "monitor, which takes them for two"))
      << why;
}

TEST(Sensors, ViewsOfOneTopicHaveTheirPlacesInOneMap) {
  Camera camera;
  camera.showCamera("other");
  EXPECT_EQ(camera.add(cloudOf(1, {{0.05f, -0.05f, 1}})).surface->leafCount(), 1u);
  EXPECT_EQ(camera.add(cloudOf(1, {{0.25f, -0.05f, 1}}, "other")).surface->leafCount(), 2u);
}

/// All that comes of a loader, in order.
class Maps {
 public:
  void take(MapLoader& loader) {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (LoadedMap map; loader.take(map);) maps_.push_back(std::move(map));
  }
  std::vector<LoadedMap> waitFor(std::size_t count) {
    const std::int64_t start_ns = steadyNs();
    while (secondsBetween(start_ns, steadyNs()) < 20) {
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (maps_.size() >= count) return maps_;
      }
      std::this_thread::yield();
    }
    return maps_;
  }

 private:
  std::mutex mutex_;
  std::vector<LoadedMap> maps_;
};

TEST(Sensors, EachViewHasItsPlaceToWaitAndItsTurn) {
  XmlRpcValue tree;
  tree["obstacle_cloud_topic"] = "/camera/points";
  tree["obstacle_resolution_m"] = 0.1;
  Driven driven(tree);
  for (const char* frame : {"camera", "other"}) {
    geometry_msgs::TransformStamped pose = cameraPose(1);
    pose.child_frame_id = frame;
    driven.tell({pose}, true);
  }
  Maps maps;
  std::atomic<MapLoader*> made{nullptr};
  MapLoader loader(driven.config, driven.feed_tf, [&] { maps.take(*made); });
  made = &loader;
  const auto submit = [&](double stamp_s, const std::string& frame, std::int64_t arrival_ns) {
    loader.submit(messageOf(cloudOf(stamp_s, {{frame == "camera" ? 0.05f : 0.25f, 0, 1}}, frame)), arrival_ns);
  };
  const std::int64_t now_ns = steadyNs();
  submit(1.0, "camera", now_ns);
  submit(1.1, "other", now_ns + 1);
  submit(1.2, "camera", now_ns + 2);
  submit(1.3, "camera", now_ns + 3);
  EXPECT_EQ(loader.dropped(), 2u) << "before they were decoded";
  loader.setFixedFrame("world");
  const std::vector<LoadedMap> made_maps = maps.waitFor(2);
  ASSERT_EQ(made_maps.size(), 2u);
  EXPECT_EQ(made_maps[0].stamp_ns, 1'300'000'000);
  EXPECT_EQ(made_maps[0].arrival_ns, now_ns) << "what came of the other view is not in it";
  EXPECT_EQ(made_maps[1].stamp_ns, 1'100'000'000);
  EXPECT_EQ(made_maps[1].arrival_ns, now_ns + 1);
  EXPECT_EQ(made_maps[1].surface->leafCount(), 2u);
  EXPECT_EQ(loader.received(), 4u);
}

TEST(Sensors, AViewThatIsBehindClearsEverySecondTime) {
  Camera camera;
  CloudMessage message = messageOf(pictureOf(1, tableDepth), 0, 1);
  const auto add = [&] { return camera.clouds.add(message, [] { return false; }).problem; };
  for (int i = 0; i < 3; ++i) EXPECT_EQ(add(), "");
  EXPECT_EQ(camera.clouds.counters().only_filled, 0u);
  message.is_behind = true;
  for (int i = 0; i < 6; ++i) EXPECT_EQ(add(), "");
  EXPECT_EQ(camera.clouds.counters().only_filled, 3u);
}

/// The table, and something at the height 0.35 above it if wanted.
sensor_msgs::PointCloud2 tableAnd(bool with_obstacle, double stamp_s) {
  sensor_msgs::PointCloud2 cloud = tableFrom(stamp_s);
  if (!with_obstacle) return cloud;
  const float point[3] = {0.22f, -0.22f, 0.7f};
  std::memcpy(cloud.data.data(), point, sizeof point);
  return cloud;
}

// With an obstacle in each cloud it was clear until the third look at a place that had been seen free.
TEST(Sensors, AStepThatTouchesWhatWasSeenTooSeldomIsNotProved) {
  Camera camera;
  for (int i = 0; i < 4; ++i) camera.give(camera.add(tableAnd(false, 1)));
  camera.feed(1, 0.9f);
  EXPECT_TRUE(assuranceOf(camera.feed(1.1, 0.5f)).clear()) << describe(assuranceOf(camera.outcome));
  LoadedMap map = camera.add(tableAnd(true, 1.1));
  ASSERT_TRUE(map.own.doubted_surface);
  EXPECT_EQ(map.own.doubted_surface->leafCount(), 1u);
  camera.give(std::move(map));
  const Outcome& near = camera.feed(1.2, 0.35f);
  EXPECT_EQ(near.status, StepStatus::OK);
  EXPECT_TRUE(near.contacts.empty());
  EXPECT_FALSE(assuranceOf(near).proved);
  EXPECT_TRUE(says(describe(assuranceOf(near)),
                   "the step touches one of 1 voxel in which a sensor saw something, but not often enough"));
  EXPECT_EQ(near.step->map.own.doubted, 1u);
  camera.feed(1.3, 0.5f);
  EXPECT_TRUE(assuranceOf(camera.feed(1.4, 0.6f)).clear()) << "it goes away: " << describe(assuranceOf(camera.outcome));
  camera.give(camera.add(tableAnd(true, 1.4)));
  EXPECT_FALSE(camera.feed(1.5, 0.35f).contacts.empty()) << "it was seen again";
}

/// The table, and 0.35 above it up to four points, in voxels beside each other.
sensor_msgs::PointCloud2 tableAndGroup(std::size_t points, double stamp_s) {
  sensor_msgs::PointCloud2 cloud = tableFrom(stamp_s);
  for (std::size_t i = 0; i < points; ++i) {
    const float point[3] = {i % 2 == 0 ? 0.22f : 0.32f, i < 2 ? -0.22f : -0.32f, 0.7f};
    std::memcpy(cloud.data.data() + i * cloud.point_step, point, sizeof point);
  }
  return cloud;
}

// What moves in front of a camera is seen in each voxel once or twice: it was near to nothing until a step touched it.
// A few pixels that fly along an edge are no such thing.
TEST(Sensors, DistancesAreTakenToWhatWasSeenTooSeldom) {
  for (const std::size_t points : {0u, 3u, 4u}) {
    for (const bool is_excluded : {false, true}) {
      Camera camera(std::string("effects: {clearance: 'on'}, clearance: {max_m: 2.0}") +
                    (is_excluded ? ", exclude_boxes: [[-1.0, -1.0, 0.2, 1.0, 1.0, 0.45]]" : ""));
      for (int i = 0; i < 4; ++i) camera.give(camera.add(tableAnd(false, 1)));
      camera.feed(1, 0.6f);
      camera.feed(1.1, 0.6f);
      camera.give(camera.add(tableAndGroup(points, 1.1)));
      const Outcome& outcome = camera.feed(1.2, 0.6f);
      EXPECT_TRUE(assuranceOf(outcome).clear()) << describe(assuranceOf(outcome));
      ASSERT_EQ(outcome.clearances.size(), 1u);
      const ClearanceDistance& distance = outcome.clearances[0].over_step;
      const double truth_m = points == 4 && !is_excluded ? 0.2 : 0.5;  // to the tops of its voxel and of the table's
      EXPECT_EQ(distance.status, ClearanceStatus::MEASURED);
      EXPECT_NEAR(distance.upper_m, truth_m, 1e-3) << points << is_excluded;
      EXPECT_LE(distance.lower_m, distance.upper_m);
      if (points == 4) {
        camera.showCamera("other");
        camera.give(camera.add(cloudOf(1.15, {{0.0125f, -0.0125f, 1}}, "other")));
        const double now_m = camera.feed(1.22, 0.6f).clearances[0].over_step.upper_m;
        EXPECT_NEAR(now_m, truth_m, 1e-3) << "another one does not look there";
        camera.give(camera.add(cloudOf(1.2, {{0.0125f, -0.0125f, 1}})));
        const Outcome& unseen = camera.feed(1.25, 0.6f);
        EXPECT_EQ(unseen.step->map.own.doubted, 4u) << "nobody looked there";
        EXPECT_NEAR(unseen.clearances[0].over_step.lower_m, 0.5, 1e-3) << "but it was not seen of late";
      }
      camera.give(camera.add(tableAnd(false, 1.25)));
      EXPECT_NEAR(camera.feed(1.3, 0.6f).clearances[0].over_step.lower_m, 0.5, 1e-3) << "it went away";
    }
  }
}

TEST(Sensors, WhatIsSeenOfABodyIsNotInDoubt) {
  for (const bool is_near : {true, false}) {
    Camera camera("own_voxels_m: auto");
    camera.feed(1, 0.9f);
    for (int i = 1; i <= 4; ++i) {
      camera.give(camera.add(tableAnd(false, 1 + 0.1 * i)));
      camera.feed(1.05 + 0.1 * i, 0.9f);
    }
    double stamp_s = 1.5;
    if (is_near) camera.feed(stamp_s += 0.1, 0.35f);
    if (is_near) camera.feed(stamp_s += 0.1, 0.35f);
    camera.give(camera.add(tableAnd(true, stamp_s)));
    const Outcome& step = camera.feed(stamp_s + 0.1, 0.35f);
    EXPECT_EQ(step.status, StepStatus::OK) << step.reason;
    EXPECT_TRUE(step.contacts.empty());
    EXPECT_EQ(assuranceOf(step).proved, is_near) << describe(assuranceOf(step));
    EXPECT_EQ(step.step->map.own.doubted, is_near ? 0u : 1u);
  }
}

TEST(Sensors, ACamerasCloudThatIsNamedAsAMeshIsHintedAt) {
  Driven small(scene());
  sensor_msgs::PointCloud2 cloud = pointsOf(1, tableDepth);
  small.take(0, bytesOf(cloud));
  EXPECT_EQ(small.pipeline.hint(0), "") << "64 x 64 may be a cloth";
  cloud.data.clear();
  cloud.width = 160;
  cloud.height = 120;
  cloud.row_step = 12 * cloud.width;
  for (std::size_t i = 0; i < 160 * 120; ++i) {
    const float p[3] = {0.01f * static_cast<float>(i % 160), 0.01f * static_cast<float>(i / 160), 1};
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(p);
    cloud.data.insert(cloud.data.end(), bytes, bytes + sizeof p);
  }
  Driven camera(scene());
  camera.take(0, bytesOf(cloud));
  EXPECT_TRUE(says(camera.pipeline.hint(0), "a cloud of 160 x 120 points is taken for a grid"));
  EXPECT_TRUE(says(camera.pipeline.hint(0), "name it as obstacle_cloud, or set topology/source: depth_image"));
}

TEST(Sensors, WhatTakesTooLongIsSaidInPlaceOfTheRate) {
  Camera camera("octomap_timeout_s: 1.0");
  LoadedMap map = camera.add(tableFrom(1));
  EXPECT_EQ(map.slow, "") << "it takes a few milliseconds";
  map.slow = "a cloud on /camera/points takes 700 ms to become part of the map";
  camera.give(std::move(map));
  camera.feed(3, 0.9f);
  EXPECT_EQ(camera.feed(3.1, 0.9f).status, StepStatus::NO_MAP) << "the map is too old by now";
  EXPECT_EQ(camera.pipeline.statement().hint, "a cloud on /camera/points takes 700 ms to become part of the map");
}

}  // namespace
}  // namespace test
}  // namespace dccd
