// The table of the kinds of pairs: its names say what its numbers say.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "dccd/contact.h"

namespace dccd {
namespace {

TEST(PairKinds, VerticesAreThoseOfTheFeaturesInTheName) {
  const std::map<std::string, std::size_t> vertices{{"vertex", 1}, {"edge", 2}, {"face", 3}, {"voxel", 0}};
  for (std::size_t k = 0; k < std::size(PAIR_KINDS); ++k) {
    const PairKindFacts& facts = factsOf(static_cast<PairKind>(k));
    const std::string name = toString(static_cast<PairKind>(k));
    EXPECT_EQ(name, facts.name);
    const std::size_t dash = name.find('-');
    const std::string second = name.substr(dash + 1);
    EXPECT_EQ(facts.vertices[0], vertices.at(name.substr(0, dash))) << name;
    EXPECT_EQ(facts.vertices[1], vertices.at(second.substr(0, second.find('-')))) << name;
    EXPECT_EQ(facts.isOnMap(), second.rfind("voxel", 0) == 0) << name;
    std::string words = name;
    words.replace(dash, 1, " against ");
    if (facts.isOnMap()) words[words.rfind('-')] = ' ';
    EXPECT_EQ(facts.words, words);
  }
  EXPECT_STREQ(factsOf(PairKind::VERTEX_FACE).name, "vertex-face");
  EXPECT_STREQ(factsOf(PairKind::EDGE_EDGE).name, "edge-edge");
  EXPECT_STREQ(factsOf(PairKind::VERTEX_VOXEL_FACE).name, "vertex-voxel-face");
  EXPECT_STREQ(factsOf(PairKind::EDGE_VOXEL_EDGE).name, "edge-voxel-edge");
  EXPECT_STREQ(factsOf(PairKind::FACE_VOXEL_CORNER).name, "face-voxel-corner");
  EXPECT_STREQ(toString(static_cast<PairKind>(std::size(PAIR_KINDS))), "unknown");
}

TEST(PairKinds, VerticesOfAContactAreThoseOfItsBodies) {
  Contact contact;
  contact.body = {7, 8};
  const auto bodies = [&](PairKind kind) {
    contact.kind = kind;
    return std::array<std::uint16_t, 4>{contact.bodyOf(0), contact.bodyOf(1), contact.bodyOf(2), contact.bodyOf(3)};
  };
  EXPECT_EQ(bodies(PairKind::VERTEX_FACE), (std::array<std::uint16_t, 4>{7, 8, 8, 8}));
  EXPECT_EQ(bodies(PairKind::EDGE_EDGE), (std::array<std::uint16_t, 4>{7, 7, 8, 8}));
  EXPECT_EQ(bodies(PairKind::FACE_VOXEL_CORNER)[2], 7) << "all of the mesh feature";
}

}  // namespace
}  // namespace dccd
