// Round trips with liboctomap's own writers, and streams that are cut, flipped or made to hurt.
#include "base/octomap_decode.h"

#include <gtest/gtest.h>
#include <octomap/ColorOcTree.h>
#include <octomap/OcTree.h>
#include <octomap/OcTreeStamped.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <set>
#include <sstream>
#include <tuple>

#include "dccd/assurance.h"
#include "dccd/detect.h"
#include "dccd/known_space.h"
#include "support/said.h"

namespace dccd {
namespace {

using Leaves = std::vector<std::tuple<int, int, int, std::uint32_t>>;

Leaves sorted(const std::vector<OccupiedLeaf>& leaves) {
  Leaves list;
  for (const OccupiedLeaf& leaf : leaves) list.emplace_back(leaf.min.x, leaf.min.y, leaf.min.z, leaf.size);
  std::sort(list.begin(), list.end());
  return list;
}

template <class Tree>
Leaves leavesOf(const Tree& tree, bool occupied) {
  Leaves list;
  if (tree.size() == 0) return list;
  for (auto it = tree.begin_leafs(), end = tree.end_leafs(); it != end; ++it) {
    if (tree.isNodeOccupied(*it) != occupied) continue;
    const octomap::OcTreeKey key = it.getIndexKey();
    list.emplace_back(key[0], key[1], key[2], 1u << (16 - it.getDepth()));
  }
  std::sort(list.begin(), list.end());
  return list;
}

/// Blocks of 4^1, 4^2, … 4^8 voxels a side that hold a leaf which is smaller.
std::size_t nodesOf(const std::vector<OccupiedLeaf>& leaves) {
  std::set<std::tuple<int, int, int, int>> nodes;
  for (const OccupiedLeaf& leaf : leaves) {
    for (int shift = 2; shift <= 16; shift += 2) {
      if (1u << shift > leaf.size) nodes.emplace(shift, leaf.min.x >> shift, leaf.min.y >> shift, leaf.min.z >> shift);
    }
  }
  return nodes.size();
}

/// A ball on a floor: pruned leaves of several sizes, free and occupied, both signs of coordinates.
template <class Tree>
void paint(Tree& tree, int reach) {
  for (int x = -reach; x < reach; ++x) {
    for (int y = -reach; y < reach; ++y) {
      for (int z = -reach; z < reach; ++z) {
        const bool ball = x * x + y * y + z * z < reach * reach / 2, floor = z < -reach / 2;
        if ((x + 3 * y + 5 * z) % 11 == 0) continue;  // unknown
        tree.updateNode(octomap::OcTreeKey(32768 + x, 32768 + y, 32768 + z), ball || floor, true);
      }
    }
  }
  for (int x = 64; x < 80; ++x) {
    for (int y = 64; y < 80; ++y) {
      for (int z = 64; z < 80; ++z) tree.updateNode(octomap::OcTreeKey(32768 + x, 32768 + y, 32768 + z), true, true);
    }
  }
  tree.updateInnerOccupancy();
  tree.toMaxLikelihood();
  tree.setNodeValue(octomap::OcTreeKey(32768 + 40, 32768, 32768), 0.0f);  // even odds
  tree.prune();
}

struct Stream {
  std::string id;
  double resolution;
  bool binary;
  std::string data;
};

DecodedOctomap decode(const Stream& stream, const OctomapLimits& limits = {}) {
  return decodeOctomap({stream.id, stream.resolution, stream.binary, stream.data.data(), stream.data.size()}, limits);
}

std::string errorOf(const Stream& stream, const OctomapLimits& limits = {}) {
  return test::said<OctomapError>([&] { decode(stream, limits); });
}

template <class Tree>
std::vector<Stream> streamsOf(Tree& tree) {
  std::vector<Stream> streams;
  for (const bool binary : {true, false}) {
    for (const bool header : {true, false}) {
      std::ostringstream out;
      if (binary && header) tree.writeBinaryConst(out);
      if (binary && !header) tree.writeBinaryData(out);
      if (!binary && header) tree.write(out);
      if (!binary && !header) tree.writeData(out);
      streams.push_back({tree.getTreeType(), tree.getResolution(), binary, out.str()});
    }
  }
  return streams;
}

// As OctoMap wrote them before 1.0, and liboctomap still reads them.
TEST(OctomapDecode, AFileOfBeforeHeadersIsRead) {
  octomap::OcTree tree(0.05);
  paint(tree, 9);
  tree.toMaxLikelihood();
  std::ostringstream out;
  const std::int32_t type = 3;
  const double resolution = tree.getResolution();
  const auto nodes = static_cast<std::uint32_t>(tree.size());
  out.write(reinterpret_cast<const char*>(&type), sizeof type);
  out.write(reinterpret_cast<const char*>(&resolution), sizeof resolution);
  out.write(reinterpret_cast<const char*>(&nodes), sizeof nodes);
  tree.writeBinaryData(out);
  const std::string path = (std::filesystem::temp_directory_path() / "dccd_before_headers.bt").string();
  std::ofstream(path, std::ios::binary) << out.str();
  octomap::OcTree theirs(path);
  const DecodedOctomap map = readOctomapFile(path);
  EXPECT_EQ(map.resolution_m, 0.05);
  EXPECT_EQ(sorted(map.occupied), leavesOf(theirs, true));
  EXPECT_GT(map.occupied.size(), 100u);
  std::ofstream(path, std::ios::binary) << out.str().substr(0, out.str().size() - 1);
  EXPECT_NE(test::said<OctomapError>([&] { readOctomapFile(path); }).find("data end"), std::string::npos);
  std::filesystem::remove(path);
}

template <class Tree>
class OctomapRoundTrip : public testing::Test {};
using TreeTypes = testing::Types<octomap::OcTree, octomap::ColorOcTree, octomap::OcTreeStamped>;
TYPED_TEST_SUITE(OctomapRoundTrip, TreeTypes);

TYPED_TEST(OctomapRoundTrip, EveryStreamGivesTheTreesLeaves) {
  TypeParam tree(0.05);
  paint(tree, 9);
  ASSERT_GT(leavesOf(tree, true).size(), 100u);
  ASSERT_GT(leavesOf(tree, false).size(), 100u);
  for (const Stream& stream : streamsOf(tree)) {
    const DecodedOctomap map = decode(stream);
    EXPECT_EQ(map.id, tree.getTreeType());
    EXPECT_EQ(map.resolution_m, 0.05);
    EXPECT_EQ(sorted(map.occupied), leavesOf(tree, true));
    EXPECT_EQ(sorted(map.free), leavesOf(tree, false));
    const auto largest = std::max_element(map.occupied.begin(), map.occupied.end(),
                                          [](const OccupiedLeaf& a, const OccupiedLeaf& b) { return a.size < b.size; });
    EXPECT_EQ(largest->size, 16u) << "a pruned leaf was expanded";
    EXPECT_EQ(VoxelSurface::build(map.resolution_m, map.occupied)->leafCount(), map.occupied.size());
  }
}

TYPED_TEST(OctomapRoundTrip, AnEmptyTreeIsAValidEmptyMap) {
  TypeParam tree(0.1);
  for (const Stream& stream : streamsOf(tree)) {
    const DecodedOctomap map = decode(stream);
    EXPECT_TRUE(map.occupied.empty());
    EXPECT_TRUE(map.free.empty());
  }
}

TYPED_TEST(OctomapRoundTrip, CutAtEveryByteItIsRefused) {
  TypeParam tree(0.1);
  paint(tree, 3);
  for (const Stream& stream : streamsOf(tree)) {
    Stream cut = stream;
    for (std::size_t size = 1; size < stream.data.size(); ++size) {
      cut.data = stream.data.substr(0, size);
      EXPECT_THROW(decode(cut), OctomapError) << size << " of " << stream.data.size() << " bytes";
    }
    cut.data = stream.data + '\0';
    EXPECT_THROW(decode(cut), OctomapError) << "a trailing byte";
  }
}

TYPED_TEST(OctomapRoundTrip, WhatItReadsOfDamagedStreamsIsWhatLiboctomapReads) {
  TypeParam tree(0.1);
  paint(tree, 4);
  std::mt19937 random(7);
  int compared = 0;
  for (const Stream& stream : streamsOf(tree)) {
    if (stream.data[0] == '#') continue;
    for (int i = 0; i < 1000; ++i) {
      Stream bad = stream;
      for (unsigned flips = 1 + random() % 4; flips > 0; --flips) {
        bad.data[random() % bad.data.size()] ^= static_cast<char>(1u << random() % 8);
      }
      DecodedOctomap map;
      try {
        map = decode(bad);
      } catch (const OctomapError&) {
        continue;
      }
      TypeParam other(0.1);
      std::istringstream in(bad.data);
      if (bad.binary) {
        other.readBinaryData(in);
      } else {
        other.readData(in);
      }
      EXPECT_EQ(sorted(map.occupied), leavesOf(other, true));
      EXPECT_EQ(sorted(map.free), leavesOf(other, false));
      ++compared;
    }
  }
  EXPECT_GT(compared, 100);
}

TEST(OctomapDecode, ErrorsNameTheFieldAndTheValue) {
  EXPECT_NE(errorOf({"PointCloud", 0.1, true, ""}).find("PointCloud"), std::string::npos);
  EXPECT_EQ(errorOf({"OcTree", 0, true, ""}), "octomap resolution is 0, which is not a length from 1e-290 to 1e290 m");
  EXPECT_NE(errorOf({"OcTree", -0.5, true, ""}).find("-0.5"), std::string::npos);
  EXPECT_NE(errorOf({"OcTree", std::numeric_limits<double>::quiet_NaN(), true, ""}).find("nan"), std::string::npos);
  EXPECT_NE(errorOf({"OcTree", std::numeric_limits<double>::infinity(), true, ""}).find("inf"), std::string::npos);
  const std::string header = "# Octomap OcTree binary file\nid OcTree\nsize 3\nres 0.1\ndata\n";
  EXPECT_NE(errorOf({"OcTree", 0.2, true, header + "ab"}).find("0.1"), std::string::npos);
  EXPECT_NE(errorOf({"OcTree", 0.1, false, header + "ab"}).find(".bt"), std::string::npos);
  EXPECT_NE(errorOf({"ColorOcTree", 0.1, true, header + "ab"}).find("ColorOcTree"), std::string::npos);
  const std::string begin = "# Octomap OcTree binary file\nid OcTree\nres 0.1\n";
  EXPECT_NE(errorOf({"OcTree", 0.1, true, begin + "size 0\ndata\nab"}).find("2 bytes of data follow"),
            std::string::npos);
  EXPECT_NE(errorOf({"OcTree", 0.1, true, begin + "sizes 3\ndata\nab"}).find("keyword 'sizes'"), std::string::npos);
  EXPECT_NE(errorOf({"OcTree", 0.1, true, "# Octomap OcTree binary file\nid OcTree\n"}).find("data"),
            std::string::npos);
}

TEST(OctomapDecode, HostileStreamsAreRefusedSoon) {
  // Every child inner, for ever: deeper than any map.
  EXPECT_NE(errorOf({"OcTree", 0.1, true, std::string(1 << 20, '\xff')}).find("16 levels"), std::string::npos);
  std::string full;
  for (int i = 0; i < 1000; ++i) full += std::string("\0\0\0\0\x01", 5);
  EXPECT_NE(errorOf({"OcTree", 0.1, false, full}).find("16 levels"), std::string::npos);
  // Few bytes cannot claim many leaves; limits are checked before anything is allocated.
  EXPECT_NE(errorOf({"OcTree", 0.1, true, std::string("\xaa\xaa", 2)}, {1, 100}).find("limit"), std::string::npos);
  EXPECT_NE(errorOf({"OcTree", 0.1, true, std::string("\xaa\xaa", 2)}, {100, 7}).find("limit"), std::string::npos);
  EXPECT_EQ(errorOf({"OcTree", 0.1, true, std::string("\xaa\xaa", 2)}, {100, 8}), "");
  // A log-odds that is not a number.
  EXPECT_NE(errorOf({"OcTree", 0.1, false, std::string("\xff\xff\xff\xff\0", 5)}).find("log-odds"), std::string::npos);
}

// What is counted in the stream is what the trees are then built of.
TEST(OctomapDecode, CountsAreThoseOfTheTrees) {
  octomap::OcTree tree(0.05);
  paint(tree, 5);
  std::ostringstream stream;
  tree.writeBinaryData(stream);
  OctomapCounts counts;
  OctomapLimits limits;
  limits.accept = [&](const OctomapCounts& counted) { counts = counted; };
  const std::string bytes = stream.str();
  const DecodedOctomap map = decodeOctomap({"OcTree", 0.05, true, bytes.data(), bytes.size()}, limits);
  EXPECT_EQ(counts.occupied, map.occupied.size());
  EXPECT_EQ(counts.free, map.free.size());
  std::vector<OccupiedLeaf> known = map.occupied;
  known.insert(known.end(), map.free.begin(), map.free.end());
  EXPECT_GT(counts.occupied_nodes, 50u);
  EXPECT_EQ(counts.occupied_nodes, nodesOf(map.occupied));
  EXPECT_EQ(counts.known_nodes, nodesOf(known));
  // Whoever refuses them does so before there are any; free ones can be left out.
  limits.accept = [](const OctomapCounts&) { throw OctomapError("too many"); };
  EXPECT_THROW(decodeOctomap({"OcTree", 0.05, true, bytes.data(), bytes.size()}, limits), OctomapError);
  limits.accept = nullptr;
  limits.free_leaves = false;
  EXPECT_TRUE(decodeOctomap({"OcTree", 0.05, true, bytes.data(), bytes.size()}, limits).free.empty());
}

/// The full stream of a tree that is its root alone, and the same with the header of a file.
template <class Tree>
std::vector<Stream> rootAlone(const Tree& tree, float log_odds) {
  std::string bytes(sizeof log_odds, '\0');
  std::memcpy(bytes.data(), &log_odds, sizeof log_odds);
  if (tree.getTreeType() == "ColorOcTree") bytes += "rgb";
  bytes += '\0';  // no children
  const std::string id = tree.getTreeType();
  const std::string header = "# Octomap OcTree file\nid " + id + "\nsize 1\nres 0.1\ndata\n";
  return {{id, 0.1, false, bytes}, {id, 0.1, false, header + bytes}};
}

TYPED_TEST(OctomapRoundTrip, ARootThatIsALeafIsAllOfTheSpace) {
  for (const float log_odds : {3.5f, 0.0f, -0.5f, std::numeric_limits<float>::infinity()}) {
    TypeParam tree(0.1);
    for (const Stream& stream : rootAlone(tree, log_odds)) {
      const DecodedOctomap map = decode(stream);
      const Leaves all{{0, 0, 0, 65536}}, none;
      EXPECT_EQ(sorted(map.occupied), log_odds >= 0 ? all : none) << log_odds;
      EXPECT_EQ(sorted(map.free), log_odds >= 0 ? none : all) << log_odds;
      if (stream.data[0] == '#') continue;
      std::istringstream in(stream.data);
      tree.readData(in);
      EXPECT_EQ(sorted(map.occupied), leavesOf(tree, true)) << log_odds;
      EXPECT_EQ(sorted(map.free), leavesOf(tree, false)) << log_odds;
    }
  }
}

// All occupied, all free and all unknown are written alike: two bytes that name no child.
TYPED_TEST(OctomapRoundTrip, ABinaryRootWithoutChildrenIsRefused) {
  TypeParam tree(0.1);
  std::istringstream in(rootAlone(tree, 3.5f)[0].data);
  tree.readData(in);
  ASSERT_EQ(tree.size(), 1u);
  for (const Stream& stream : streamsOf(tree)) {
    if (!stream.binary) {
      EXPECT_EQ(decode(stream).occupied.size(), 1u) << "liboctomap's own stream";
      continue;
    }
    const std::string error = errorOf(stream);
    EXPECT_NE(error.find("a root without children"), std::string::npos) << error;
    EXPECT_NE(error.find("binary: false"), std::string::npos) << "the remedy: " << error;
  }
}

TYPED_TEST(OctomapRoundTrip, ARootWithoutDataIsRefused) {
  for (const bool binary : {true, false}) {
    const TypeParam tree(0.1);
    const std::string id = tree.getTreeType();
    const std::string kind = binary ? "binary file" : "file";
    EXPECT_NE(errorOf({id, 0.1, binary, "# Octomap OcTree " + kind + "\nid " + id + "\nsize 1\nres 0.1\ndata\n"}), "");
    EXPECT_NE(errorOf({id, 0.1, binary, std::string(1, '\0')}), "");
  }
}

// Wherever a mesh is, and wherever it goes within the octree's space, it is in what is occupied.
TEST(OctomapDecode, InASolidMapNothingIsClear) {
  const DecodedOctomap map = decode(rootAlone(octomap::OcTree(0.1), 3.5f)[0]);
  const auto surface = VoxelSurface::build(map.resolution_m, map.occupied);
  for (const double at : {-3000.0, -0.05, 0.0, 0.05, 1.0, 3000.0}) {
    Step step;
    step.stamp_ns = 1;
    step.bodies.resize(1);
    step.bodies[0].topology = share(Topology::fromTriangles(3, {{0, 1, 2}}));
    const Positions x{{at, at, 0}, {at + 0.1, at, 0}, {at, at + 0.1, 0}};
    Positions moved = x;
    for (Vec3& p : moved) p.z() += 0.02;
    step.bodies[0].t0 = std::make_shared<const Positions>(x);
    step.bodies[0].t1 = std::make_shared<const Positions>(moved);
    step.map.surface = surface;
    History history;
    const Outcome outcome = detect(step, Options(), history);
    EXPECT_FALSE(assuranceOf(outcome).clear()) << at;
    EXPECT_EQ(outcome.start_state, StartState::INTERSECTING) << at;
    EXPECT_GT(outcome.counts.initial, 0u) << at;
  }
}

TEST(OctomapDecode, FilesAreReadByTheirHeader) {
  octomap::OcTree tree(0.05);
  paint(tree, 5);
  const std::filesystem::path folder = std::filesystem::temp_directory_path();
  for (const std::string name : {"deformable_ccd_decode.bt", "deformable_ccd_decode.ot"}) {
    const std::string path = (folder / name).string();
    ASSERT_TRUE(name.back() == 't' && name[name.size() - 2] == 'b' ? tree.writeBinaryConst(path) : tree.write(path));
    const DecodedOctomap map = readOctomapFile(path);
    EXPECT_EQ(map.resolution_m, 0.05);
    EXPECT_EQ(sorted(map.occupied), leavesOf(tree, true));
    std::filesystem::remove(path);
  }
  const std::string text = test::said<OctomapError>([&] { readOctomapFile((folder / "no_such_map.bt").string()); });
  EXPECT_NE(text.find("no_such_map.bt"), std::string::npos);
}

}  // namespace
}  // namespace dccd
