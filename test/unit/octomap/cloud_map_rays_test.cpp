// What is cleared of a view, against all of its rays by another way; and the octree, against liboctomap's own updates
// of single voxels.
#include <gtest/gtest.h>
#include <octomap/OcTree.h>

#include <algorithm>
#include <array>
#include <set>
#include <sstream>

#include "base/cloud_map.h"
#include "dccd/tolerances.h"
#include "support/seen_scene.h"

namespace dccd {
namespace {

constexpr std::size_t PLENTY = std::size_t{1} << 32;

using Key = std::array<int, 3>;
using Keys = std::set<Key>;

/// Voxels of leaves.
Keys expanded(const std::vector<OccupiedLeaf>& leaves) {
  Keys keys;
  for (const OccupiedLeaf& leaf : leaves) {
    const int size = static_cast<int>(leaf.size);
    for (int x = 0; x < size; ++x) {
      for (int y = 0; y < size; ++y) {
        for (int z = 0; z < size; ++z) keys.insert({leaf.min.x + x, leaf.min.y + y, leaf.min.z + z});
      }
    }
  }
  return keys;
}

Key keyOf(const Vec3& p, double resolution_m) {
  Key key;
  for (int axis = 0; axis < 3; ++axis) key[axis] = 32768 + static_cast<int>(std::floor(p[axis] / resolution_m));
  return key;
}

/// Voxels through which a segment goes: those of the middles between the planes that it meets.
void addCrossed(const Vec3& from, const Vec3& to, double resolution_m, Keys& keys) {
  std::vector<double> times{0, 1};
  for (int axis = 0; axis < 3; ++axis) {
    const double a = from[axis] / resolution_m, b = to[axis] / resolution_m;
    for (double plane = std::ceil(std::min(a, b)); plane <= std::max(a, b); ++plane) {
      if (a != b) times.push_back((plane - a) / (b - a));
    }
  }
  std::sort(times.begin(), times.end());
  for (std::size_t i = 1; i < times.size(); ++i) {
    if (times[i] > times[i - 1]) keys.insert(keyOf(from + 0.5 * (times[i - 1] + times[i]) * (to - from), resolution_m));
  }
}

struct Rays {
  Keys crossed, filled;
};

/// All of a view's, of which no point is lost on the way: as the header of CloudMap has it.
Rays allRays(const SensorView& view, const CloudMapOptions& options) {
  Rays rays;
  const Vec3 sensor = view.map_from_sensor.translation();
  const double clear_m = options.max_range_m > 0 ? options.max_range_m : 1e9;
  Keys ends;
  const auto isInBox = [&](const Key& key) {
    for (int axis = 0; axis < 3 && options.box; ++axis) {
      const double lo = (key[axis] - 32768) * options.resolution_m, hi = lo + options.resolution_m;
      if (hi <= options.box->min[axis] + 1e-7 || lo >= options.box->max[axis] - 1e-7) return false;
    }
    return true;
  };
  for (std::size_t i = 0; i < view.width * view.height; ++i) {
    Vec3 p;
    bool no_return = false;
    if (view.depth_m) {
      const double z = static_cast<double>(view.depth_m[i]);
      p = Vec3((double(i % view.width) - view.pinhole.cx) / view.pinhole.fx,
               (double(i / view.width) - view.pinhole.cy) / view.pinhole.fy, 1);
      no_return = std::isinf(z);
      p *= no_return ? 1000 : z;
      if (std::isnan(z) || z <= 0) continue;
      if (no_return && !options.no_return_clears) continue;
    } else {
      p = Vec3(view.xyz[3 * i], view.xyz[3 * i + 1], view.xyz[3 * i + 2]);
      if (!p.allFinite() || p.isZero(0)) continue;
    }
    const double away_m = p.norm();
    if (away_m < options.min_range_m) continue;
    const Vec3 at = view.map_from_sensor * p;
    if (!no_return) ends.insert(keyOf(at, options.resolution_m));
    if (!no_return && away_m <= clear_m && isInBox(keyOf(at, options.resolution_m)))
      rays.filled.insert(keyOf(at, options.resolution_m));
    addCrossed(sensor, away_m > clear_m ? Vec3(sensor + (at - sensor) * (clear_m / away_m)) : at, options.resolution_m,
               rays.crossed);
  }
  for (const Key& key : ends) rays.crossed.erase(key);
  for (auto it = rays.crossed.begin(); it != rays.crossed.end();)
    it = isInBox(*it) ? std::next(it) : rays.crossed.erase(it);
  return rays;
}

/// A map that takes all that a CloudMap is given, voxel by voxel.
class ByVoxels {
 public:
  explicit ByVoxels(const CloudMapOptions& options) : tree_(options.resolution_m) {
    tree_.setProbHit(tolerance::MAP_HIT);
    tree_.setProbMiss(tolerance::MAP_MISS);
    tree_.setClampingThresMin(tolerance::MAP_LEAST);
    tree_.setClampingThresMax(tolerance::MAP_MOST);
  }
  void insert(const Keys& cleared, const Keys& filled) {
    for (const Key& key : cleared) {
      tree_.updateNode(octomap::OcTreeKey(key[0], key[1], key[2]), false);
      doubtful_.erase(key);
    }
    for (const Key& key : filled) {
      const octomap::OcTreeNode* node = tree_.updateNode(octomap::OcTreeKey(key[0], key[1], key[2]), true);
      tree_.isNodeOccupied(node) ? static_cast<void>(doubtful_.erase(key)) : static_cast<void>(doubtful_.insert(key));
    }
  }
  std::string bytes() const {
    std::ostringstream stream;
    tree_.writeData(stream);
    return stream.str();
  }
  const Keys& doubtful() const { return doubtful_; }

 private:
  octomap::OcTree tree_;
  Keys doubtful_;
};

bool areSame(const std::vector<OccupiedLeaf>& a, const std::vector<OccupiedLeaf>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const OccupiedLeaf& x, const OccupiedLeaf& y) {
    return !(x.min < y.min) && !(y.min < x.min) && x.size == y.size;
  });
}

Eigen::Isometry3d somePose(std::mt19937& random, double within_m) {
  std::uniform_real_distribution<double> unit(-1, 1);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() =
      Eigen::Quaterniond(unit(random), unit(random), unit(random), unit(random)).normalized().toRotationMatrix();
  pose.translation() = within_m * Vec3(unit(random), unit(random), unit(random));
  return pose;
}

/// Lost squares, single lost pixels, zeros, and flying pixels.
void spoil(std::mt19937& random, std::size_t width, std::vector<float>& depths, float no_return) {
  std::uniform_real_distribution<float> unit(0, 1);
  const std::size_t height = depths.size() / width;
  for (int hole = 0; hole < 6; ++hole) {
    const std::size_t side = 1 + random() % 12, u0 = random() % width, v0 = random() % height;
    const float value = hole < 4 ? std::numeric_limits<float>::quiet_NaN() : hole == 4 ? 0.0f : no_return;
    for (std::size_t v = v0; v < std::min(height, v0 + side); ++v) {
      for (std::size_t u = u0; u < std::min(width, u0 + side); ++u) depths[v * width + u] = value;
    }
  }
  for (std::size_t i = 1; i < depths.size(); ++i) {
    if (unit(random) < 0.01f) depths[i] = std::numeric_limits<float>::quiet_NaN();
    if (unit(random) < 0.003f) depths[i] *= 0.3f + 0.6f * unit(random);
  }
}

/// One view after the other, in one map and each in a map of its own, which shows what it cleared.
class Held {
 public:
  Held(const CloudMapOptions& options, double least)
      : options_(options), least_(least), map_(options), by_voxels_(options) {}

  void insert(const SensorView& view, bool is_picture) {
    CloudMap fresh(options_);
    const SeenCounts counts = fresh.insert(view, PLENTY);
    ASSERT_EQ(counts.is_picture, is_picture);
    EXPECT_EQ(counts.filled + counts.near + counts.far + counts.outside + counts.no_return + counts.nothing,
              view.width * view.height);
    const Keys cleared = expanded(fresh.leaves().free), filled = expanded(fresh.leaves().occupied);
    const Rays rays = allRays(view, options_);
    EXPECT_TRUE(filled == rays.filled) << filled.size() << " for " << rays.filled.size();
    std::size_t more = 0;
    for (const Key& key : cleared) more += rays.crossed.count(key) == 0;
    EXPECT_EQ(more, 0u) << "of " << cleared.size() << " that no ray crosses";
    crossed_ += rays.crossed.size();
    cleared_ += cleared.size() - more;

    map_.insert(view, PLENTY);
    by_voxels_.insert(cleared, filled);
    const std::vector<std::int8_t> bytes = map_.serialized(false);
    const std::string expected = by_voxels_.bytes();
    ASSERT_TRUE(std::equal(bytes.begin(), bytes.end(), expected.begin(), expected.end())) << "another tree";
    const DecodedOctomap leaves = map_.leaves();
    const DecodedOctomap decoded =
        decodeOctomap({"OcTree", options_.resolution_m, false, expected.data(), expected.size()});
    EXPECT_TRUE(areSame(decoded.occupied, leaves.occupied));
    EXPECT_TRUE(areSame(decoded.free, leaves.free));
    EXPECT_TRUE(expanded(map_.doubtful()) == by_voxels_.doubtful());
    doubted_ += by_voxels_.doubtful().size();
    EXPECT_TRUE(std::is_sorted(map_.doubtful().begin(), map_.doubtful().end(),
                               [](const auto& a, const auto& b) { return mortonOf(a) < mortonOf(b); }));
  }
  std::size_t doubted() const { return doubted_; }
  ~Held() {
    EXPECT_GT(crossed_, 1000u);
    EXPECT_GE(double(cleared_), least_ * double(crossed_)) << "too little is cleared";
  }

 private:
  CloudMapOptions options_;
  double least_;
  CloudMap map_;
  ByVoxels by_voxels_;
  std::size_t crossed_ = 0, cleared_ = 0, doubted_ = 0;

  static std::uint64_t mortonOf(const OccupiedLeaf& leaf) {
    std::uint64_t code = 0;
    for (int bit = 15; bit >= 0; --bit) {
      code = code << 3 | (leaf.min.z >> bit & 1) << 2 | (leaf.min.y >> bit & 1) << 1 | (leaf.min.x >> bit & 1);
    }
    return code;
  }
};

constexpr std::size_t WIDTH = 96, HEIGHT = 64;
const Pinhole LENS{80, 82, 46.3, 33.1};

/// Returns how many voxels were in doubt. resolution: of voxels, several pixels wide where they are seen, or less than
/// one.
std::size_t holdPictures(std::uint32_t seed, double resolution_m, bool as_points, bool still, int views = 6) {
  std::mt19937 random(seed);
  const test::SeenScene scene = test::SeenScene::make(random, Vec3(2.2, 2, 1.4), 12);
  CloudMapOptions options;
  options.resolution_m = resolution_m;
  options.min_range_m = 0.1;
  options.max_range_m = seed % 2 ? 0.9 : 0;
  options.no_return_clears = options.max_range_m > 0;
  if (seed % 3 == 0) options.box = Box{Vec3(-0.7, -0.6, -0.51), Vec3(0.8, 0.5, 0.4)};
  Held held(options, 0.999);
  Eigen::Isometry3d pose = somePose(random, 0.3);
  const Eigen::Isometry3d turned(Eigen::AngleAxisd(-1.2, Vec3(0.3, 0.9, 0.1).normalized()));
  for (int i = 0; i < views; ++i) {
    if (!still) pose = somePose(random, 0.3);
    std::vector<float> depths = scene.picture(pose, LENS, WIDTH, HEIGHT);
    spoil(random, WIDTH, depths, std::numeric_limits<float>::infinity());
    SCOPED_TRACE(i);
    if (!as_points) {
      held.insert(test::viewOf(pose, depths, LENS, WIDTH), true);
      continue;
    }
    std::vector<float> xyz = test::pointsOf(depths, LENS, WIDTH);
    if (seed % 2 == 0) {  // a cloud's frame may have its axes elsewhere
      for (std::size_t p = 0; p < xyz.size(); p += 3) {
        Eigen::Map<Eigen::Vector3f> point(&xyz[p]);
        point = (turned.linear() * point.cast<double>()).cast<float>();
      }
      held.insert(test::viewOf(pose * turned.inverse(), xyz, WIDTH), true);
    } else {
      for (float& value : xyz) value = std::isinf(value) ? std::numeric_limits<float>::quiet_NaN() : value;
      held.insert(test::viewOf(pose, xyz, WIDTH), true);
    }
  }
  return held.doubted();
}

TEST(CloudMapRays, OfAPictureOfManyPixelsAVoxel) {
  for (std::uint32_t seed = 0; seed < 4; ++seed) holdPictures(seed, 0.08, false, false);
}
TEST(CloudMapRays, OfAPictureOfFewPixelsAVoxel) {
  for (std::uint32_t seed = 0; seed < 2; ++seed) holdPictures(seed, 0.02, false, false, 3);
}
TEST(CloudMapRays, OfAPictureOfVoxelsBetweenPixels) { holdPictures(2, 0.01, false, false, 1); }
TEST(CloudMapRays, OfACameraThatStandsStill) { EXPECT_GT(holdPictures(5, 0.05, false, true, 10), 20u) << "in doubt"; }
TEST(CloudMapRays, OfPointsInRows) {
  for (std::uint32_t seed = 0; seed < 4; ++seed) holdPictures(seed, 0.07, true, false);
}

TEST(CloudMapRays, OfPointsInNoOrder) {
  std::mt19937 random(3);
  const test::SeenScene scene = test::SeenScene::make(random, Vec3(2.2, 2, 1.4), 12);
  for (const double range_m : {0.0, 0.8}) {
    CloudMapOptions options;
    options.resolution_m = 0.06;
    options.max_range_m = range_m;
    Held held(options, 0.95);
    for (int i = 0; i < 6; ++i) {
      const Eigen::Isometry3d pose = somePose(random, 0.3);
      const Pinhole fine{160, 160, 95.5, 63.5};
      std::vector<float> depths = scene.picture(pose, fine, 2 * WIDTH, 2 * HEIGHT);
      spoil(random, 2 * WIDTH, depths, std::numeric_limits<float>::quiet_NaN());
      const std::vector<float> xyz = test::withoutLost(test::pointsOf(depths, fine, 2 * WIDTH));
      SCOPED_TRACE(i);
      held.insert(test::viewOf(pose, xyz), false);
    }
  }
}

/// Voxels are far smaller than what lies between two rays, so that most of each ray is followed alone.
TEST(CloudMapRays, OfFewPointsAllAround) {
  std::mt19937 random(7);
  const test::SeenScene scene = test::SeenScene::make(random, Vec3(2.2, 2, 1.4), 12);
  std::normal_distribution<double> normal(0, 1);
  for (const bool has_box : {false, true}) {
    CloudMapOptions options;
    options.resolution_m = 0.02;
    if (has_box) options.box = Box{Vec3(-0.7, -0.6, -0.51), Vec3(0.8, 0.5, 0.4)};
    Held held(options, 0.95);
    for (int i = 0; i < 3; ++i) {
      const Eigen::Isometry3d pose = somePose(random, 0.3);
      std::vector<float> xyz;
      for (int ray = 0; ray < 400; ++ray) {
        const Vec3 way = Vec3(normal(random), normal(random), normal(random)).normalized();
        const Vec3 p = way * scene.depth(pose.translation(), pose.linear() * way);
        for (int axis = 0; axis < 3; ++axis) xyz.push_back(static_cast<float>(p[axis]));
      }
      SCOPED_TRACE(i);
      held.insert(test::viewOf(pose, xyz), false);
    }
  }
}

TEST(CloudMapRays, OfALidar) {
  std::mt19937 random(4);
  const test::SeenScene scene = test::SeenScene::make(random, Vec3(10, 10, 3), 12);
  CloudMapOptions options;
  options.resolution_m = 0.2;
  Held held(options, 0.95);
  for (int i = 0; i < 3; ++i) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = Vec3(0.3 * i, -0.2, 0.1 * i);
    std::vector<float> xyz;
    for (int ring = 0; ring < 32; ++ring) {
      for (int column = 0; column < 512; ++column) {
        const double up = 0.6 * (ring / 31.0 - 0.5), around = 2 * M_PI * column / 512;
        const Vec3 way(std::cos(around) * std::cos(up), std::sin(around) * std::cos(up), std::sin(up));
        const Vec3 p = way * scene.depth(pose.translation(), way);
        for (int axis = 0; axis < 3; ++axis) xyz.push_back(static_cast<float>(p[axis]));
      }
    }
    SCOPED_TRACE(i);
    held.insert(test::viewOf(pose, xyz, 512), false);
  }
}

}  // namespace
}  // namespace dccd
