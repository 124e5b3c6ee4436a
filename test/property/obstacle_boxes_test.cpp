// The obstacle test says of each mesh triangle what the general tests say of it against every voxel as a closed box:
// the same yes or no, and the same cell of the earliest TOC.
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cmath>
#include <iostream>

#include "support/box_oracle.h"
#include "support/query_property.h"

namespace dccd {
namespace {

using test::ObstacleScene;

constexpr int KEY_ORIGIN = 32766;  // the map's zero lies between keys 32767 and 32768: coordinates of both signs
constexpr int CELLS = 8;           // voxels lie in CELLS^3 keys

const std::vector<double> RESOLUTIONS = {0.05, 1.0, 0.1, 0.25, 0.03, 1e-3, 7.3};

/// Leaves of 1, 2 and 4 voxels that do not overlap; neighbours share faces, edges and corners.
std::vector<OccupiedLeaf> drawLeaves() {
  std::vector<bool> taken(CELLS * CELLS * CELLS, false);
  std::vector<OccupiedLeaf> leaves;
  const int count = *rc::gen::inRange(1, 14);
  for (int i = 0; i < count; ++i) {
    const int size = *rc::gen::element(1, 1, 1, 2, 4);
    // Keys of leaves are multiples of their size; KEY_ORIGIN is one of 2, and 4 more than a multiple of 4 less 2.
    int cell[3];
    for (int& c : cell) {
      const int key = KEY_ORIGIN + *rc::gen::inRange(0, CELLS);
      c = key / size * size - KEY_ORIGIN;
    }
    bool fits = true;
    const auto each = [&](auto&& visit) {
      for (int x = cell[0]; x < cell[0] + size; ++x) {
        for (int y = cell[1]; y < cell[1] + size; ++y) {
          for (int z = cell[2]; z < cell[2] + size; ++z) visit(x, y, z);
        }
      }
    };
    const auto index = [](int x, int y, int z) { return static_cast<std::size_t>((x * CELLS + y) * CELLS + z); };
    each([&](int x, int y, int z) {
      const bool in_range = x >= 0 && y >= 0 && z >= 0 && x < CELLS && y < CELLS && z < CELLS;
      fits = fits && in_range && !taken[index(x, y, z)];
    });
    if (!fits) continue;
    each([&](int x, int y, int z) { taken[index(x, y, z)] = true; });
    const auto key = [&](int axis) { return static_cast<std::uint16_t>(KEY_ORIGIN + cell[axis]); };
    leaves.push_back({{key(0), key(1), key(2)}, static_cast<std::uint32_t>(size)});
  }
  return leaves;
}

/// A coordinate on a plane, one number beside it, at a voxel's middle or anywhere.
double drawCoordinate(double resolution_m) {
  const int place = *rc::gen::inRange(-1, CELLS + 2);
  const double plane = voxelPlane(KEY_ORIGIN + place, resolution_m);
  switch (*rc::gen::inRange(0, 8)) {
    case 0:
    case 1:
    case 2:
      return plane;
    case 3:
      return std::nextafter(plane, -1e300);
    case 4:
      return std::nextafter(plane, 1e300);
    case 5:
      return plane + 0.5 * resolution_m;
    default:
      return plane + resolution_m * *rc::gen::inRange(0, 1000) / 1000.0;
  }
}

Vec3 drawPoint(double resolution_m) {
  return {drawCoordinate(resolution_m), drawCoordinate(resolution_m), drawCoordinate(resolution_m)};
}

/// Where a vertex that starts at `from` ends: anywhere, displaced along an axis, or where it was.
Vec3 drawEnd(const Vec3& from, double resolution_m) {
  switch (*rc::gen::inRange(0, 4)) {
    case 0:
      return from;
    case 1: {
      Vec3 to = from;
      to[*rc::gen::inRange(0, 3)] = drawCoordinate(resolution_m);
      return to;
    }
    default:
      return drawPoint(resolution_m);
  }
}

ObstacleScene drawScene(bool polyline) {
  ObstacleScene scene;
  scene.resolution_m = *rc::gen::elementOf(RESOLUTIONS);
  scene.leaves = drawLeaves();
  const int vertices = polyline ? *rc::gen::inRange(2, 5) : *rc::gen::inRange(3, 6);
  // One common displacement for all vertices now and then, sometimes of a level mesh: it slides, falls flat and grazes.
  const bool rigid = *rc::gen::inRange(0, 3) == 0, level = *rc::gen::inRange(0, 2) == 0;
  const int level_axis = *rc::gen::inRange(0, 3);
  const double height = drawCoordinate(scene.resolution_m);
  Vec3 shift = Vec3::Zero();
  if (rigid) shift[level ? level_axis : *rc::gen::inRange(0, 3)] = scene.resolution_m * *rc::gen::inRange(-6, 7);
  for (int i = 0; i < vertices; ++i) {
    scene.t0.push_back(drawPoint(scene.resolution_m));
    if (rigid && level) scene.t0.back()[level_axis] = height;
    scene.t1.push_back(rigid ? Vec3(scene.t0.back() + shift) : drawEnd(scene.t0.back(), scene.resolution_m));
  }
  if (polyline) {
    scene.topology = Topology::polyline(scene.t0.size());
  } else {
    std::vector<Face> faces;
    for (Index i = 0; i + 2 < scene.t0.size(); ++i) faces.push_back({i, i + 1, i + 2});
    scene.topology = Topology::fromTriangles(scene.t0.size(), faces);
  }
  return scene;
}

std::vector<Contact> contactsOf(const ObstacleScene& scene, const ObstacleOptions& options) {
  ObstacleCheck test(options);
  std::vector<Contact> contacts;
  ObstacleStats stats;
  const auto surface = VoxelSurface::build(scene.resolution_m, scene.leaves);
  test.run({*surface, scene.topology, scene.t0, scene.t1, 3}, contacts, stats);
  return contacts;
}

std::vector<std::vector<Index>> featuresOf(const Topology& topology) {
  std::vector<std::vector<Index>> features;
  for (const Face& face : topology.faces()) features.emplace_back(face.begin(), face.end());
  if (!topology.hasFaces()) {
    for (const Edge& edge : topology.edges()) features.emplace_back(edge.begin(), edge.end());
  }
  return features;
}

struct Tally {
  int apart = 0, moving = 0, initial = 0;
};

std::string text(const std::optional<double>& toc) { return toc ? std::to_string(*toc) : "never"; }

void checkScene(const ObstacleScene& scene, int toc_bits, Tally& tally) {
  ObstacleOptions options;
  options.accuracy.toc_bits = toc_bits;
  const std::vector<Contact> contacts = contactsOf(scene, options);
  RC_ASSERT(std::is_sorted(contacts.begin(), contacts.end(), canonicalLess));
  for (std::size_t i = 1; i < contacts.size(); ++i) {
    const Contact &a = contacts[i - 1], &b = contacts[i];
    RC_ASSERT(a.kind != b.kind || a.vertex != b.vertex || !(a.voxel == b.voxel));  // one contact a feature and leaf
  }
  for (const Contact& contact : contacts) {
    RC_ASSERT(contact.certainty == Certainty::CERTAIN);
    RC_ASSERT(contact.body[0] == 3 && contact.body[1] == OBSTACLE_BODY);
    RC_ASSERT(!contact.initial || contact.toc_lower == 0);
  }
  for (const std::vector<Index>& feature : featuresOf(scene.topology)) {
    const std::optional<double> truth = test::earliestAgainstBoxes(scene, feature, toc_bits);
    const std::optional<double> found = test::earliestOfContacts(contacts, feature);
    if (truth != found) {
      RC_FAIL("feature of vertex " + std::to_string(feature[0]) + ": the boxes say " + text(truth) +
              ", the obstacle test " + text(found) + "\n" + test::describe(scene));
    }
    ++(!truth ? tally.apart : *truth > 0 ? tally.moving : tally.initial);
  }
}

void checkScenes(const std::string& name, int scenes, bool polyline) {
  Tally tally;
  rc::detail::TestParams params;
  params.seed = 20170601;
  params.maxSuccess = scenes;
  const auto result =
      rc::detail::checkTestable([&] { checkScene(drawScene(polyline), *rc::gen::element(32, 32, 10, 52), tally); },
                                rc::detail::TestMetadata(), params);
  std::ostringstream message;
  if (!result.is<rc::detail::SuccessResult>()) rc::detail::printResultMessage(result, message);
  EXPECT_TRUE(result.is<rc::detail::SuccessResult>()) << message.str();
  std::cout << name << ": " << scenes << " scenes; features apart " << tally.apart << ", touching later "
            << tally.moving << ", touching at the start " << tally.initial << "\n";
  // The scenes must exercise what they are for.
  EXPECT_GT(tally.apart, scenes / 10);
  EXPECT_GT(tally.moving, scenes / 10);
  EXPECT_GT(tally.initial, scenes / 10);
}

TEST(ObstacleBoxes, TrianglesAgreeWithTheGeneralTests) {
  checkScenes("triangles", test::longRun() ? 400000 : 10000, false);
}

TEST(ObstacleBoxes, PolylinesAgreeWithTheGeneralTests) {
  checkScenes("polylines", test::longRun() ? 400000 : 10000, true);
}

}  // namespace
}  // namespace dccd
