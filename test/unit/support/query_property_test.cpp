// The checks must be able to fail: a broken property is found, shrunk and written where it can be replayed.
#include "support/query_property.h"

#include <gtest/gtest-spi.h>
#include <gtest/gtest.h>

#include <cmath>

#include "oracle/oracle.h"
#include "support/generators.h"
#include "support/query_symmetries.h"

namespace dccd {
namespace test {
namespace {

TEST(QueryProperty, FailureShrinksToAFileThatReplays) {
  EXPECT_NONFATAL_FAILURE(checkHardQueries("self-test", 2000,
                                           [](const Query& query) -> std::string {
                                             const double x = query.motion.x[1][2][1];
                                             return std::abs(x) > 1e-3 ? "too far" : "";
                                           }),
                          "too far");
  const std::string folder = writeReplayFile("self-test-empty", Query());  // beside the file of the failure
  const std::string sibling = folder.substr(0, folder.rfind('/')) + "/self-test";
  const std::vector<QueryFileEntry> files = findQueryFiles(sibling);
  ASSERT_EQ(files.size(), 1u);
  const std::vector<Query> replayed = readQueryFile(files[0].path, files[0].kind);
  ASSERT_EQ(replayed.size(), 1u);
  const double* values = &replayed[0].motion.x[0][0][0];
  int not_zero = 0;
  for (int i = 0; i < 24; ++i) not_zero += values[i] != 0;
  EXPECT_EQ(not_zero, 1) << "all that does not matter is shrunk away";
  EXPECT_GT(std::abs(replayed[0].motion.x[1][2][1]), 1e-3);
  EXPECT_EQ(replayed[0].contact, firstContact(files[0].kind, replayed[0].motion).has_value());
}

TEST(QueryProperty, ExceptionsAreFailures) {
  EXPECT_NONFATAL_FAILURE(
      checkHardQueries("self-test-throw", 10, [](const Query&) -> std::string { throw std::runtime_error("boom"); }),
      "boom");
}

TEST(Generators, EveryHardnessIsFiniteAndHasBothAnswers) {
  for (int hardness = 0; hardness < static_cast<int>(Hardness::COUNT); ++hardness) {
    RandomSource random(static_cast<std::uint64_t>(hardness));
    int contacts = 0;
    constexpr int PAIRS = 120;
    for (int i = 0; i < PAIRS; ++i) {
      const PairKind kind = i % 2 == 0 ? PairKind::VERTEX_FACE : PairKind::EDGE_EDGE;
      const Query query = hardQuery(random, kind, static_cast<Hardness>(hardness));
      for (int k = 0; k < 24; ++k) ASSERT_TRUE(std::isfinite((&query.motion.x[0][0][0])[k]));
      ASSERT_EQ(query.kind, kind);
      contacts += firstContact(kind, query.motion).has_value();
    }
    EXPECT_GT(contacts, 0) << toString(static_cast<Hardness>(hardness));
    EXPECT_LT(contacts, PAIRS) << toString(static_cast<Hardness>(hardness));
  }
}

TEST(Generators, SymmetriesAreGroupsOfTheRightSize) {
  EXPECT_EQ(vertexPermutations(PairKind::VERTEX_FACE).size(), 6u);
  EXPECT_EQ(vertexPermutations(PairKind::EDGE_EDGE).size(), 8u);
  EXPECT_EQ(axisPermutations().size(), 48u);
}

}  // namespace
}  // namespace test
}  // namespace dccd
