#include "oracle/query_file.h"
#include "support/said.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <random>
#include <sstream>

namespace dccd {
namespace {

namespace fs = std::filesystem;

std::string repeated(const std::string& line, int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += line;
  return text;
}

std::vector<Query> parse(const std::string& text) {
  std::istringstream in(text);
  return readQueries(in, PairKind::EDGE_EDGE, "input");
}

/// The message of the error that reading `text` ends in; empty where there is none.
std::string errorOf(const std::string& text) {
  return test::said<std::runtime_error>([&] { parse(text); });
}

double randomFiniteDouble(std::mt19937_64& random) {
  for (;;) {
    const std::uint64_t bits = random();
    double value;
    std::memcpy(&value, &bits, sizeof value);
    if (std::isfinite(value)) return value;
  }
}

/// A folder that is gone at the end of the test.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    path_ = fs::temp_directory_path() / ("query_file_test_" + std::to_string(std::random_device{}()));
    fs::create_directories(path_);
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  fs::path path() const { return path_; }

 private:
  fs::path path_;
};

TEST(QueryFile, ReadsTimesPointsAndAxesInOrder) {
  std::string text;
  for (int row = 0; row < 8; ++row) {
    text += std::to_string(row) + ",1," + std::to_string(-row) + ",2,3," + std::to_string(1 << row) + ",1\n";
  }
  const std::vector<Query> queries = parse(text);
  ASSERT_EQ(queries.size(), 1u);
  EXPECT_TRUE(queries[0].contact);
  EXPECT_EQ(queries[0].kind, PairKind::EDGE_EDGE);
  EXPECT_EQ(queries[0].motion.x[0][3][0], 3.0);
  EXPECT_EQ(queries[0].motion.x[1][2][1], -3.0);
  EXPECT_EQ(queries[0].motion.x[1][3][2], 3.0 / 128);
}

TEST(QueryFile, AcceptsBlanksCarriageReturnsEmptyLinesAndUnreducedFractions) {
  const std::vector<Query> queries = parse("\n" + repeated(" 6, 4 ,-3,-2,0,7,0\r\n", 8) + "\r\n\n");
  ASSERT_EQ(queries.size(), 1u);
  EXPECT_EQ(queries[0].motion.x[0][0][0], 1.5);
  EXPECT_EQ(queries[0].motion.x[0][0][1], 1.5);
  EXPECT_EQ(queries[0].motion.x[0][0][2], 0.0);
}

TEST(QueryFile, EveryFiniteDoubleComesBackBitForBit) {
  using Limits = std::numeric_limits<double>;
  std::vector<double> values = {0.0,
                                Limits::denorm_min(),
                                -Limits::denorm_min(),
                                Limits::min(),
                                Limits::max(),
                                Limits::lowest(),
                                std::nextafter(Limits::min(), 0.0),
                                0.1,
                                -1e150,
                                1e-150};
  std::mt19937_64 random(7);
  while (values.size() < 24 * 200) values.push_back(randomFiniteDouble(random));
  std::vector<Query> queries(200);
  for (std::size_t i = 0; i < queries.size(); ++i) {
    queries[i].kind = PairKind::EDGE_EDGE;
    queries[i].contact = i % 2 == 0;
    std::memcpy(queries[i].motion.x, values.data() + 24 * i, sizeof queries[i].motion.x);
  }
  std::stringstream text;
  writeQueries(text, queries);
  const std::vector<Query> back = readQueries(text, PairKind::EDGE_EDGE, "text");
  ASSERT_EQ(back.size(), queries.size());
  for (std::size_t i = 0; i < queries.size(); ++i) {
    EXPECT_EQ(std::memcmp(back[i].motion.x, queries[i].motion.x, sizeof back[i].motion.x), 0) << "query " << i;
    EXPECT_EQ(back[i].contact, queries[i].contact);
  }
}

TEST(QueryFile, WriterRefusesWhatIsNotFinite) {
  std::vector<Query> queries(1);
  queries[0].motion.x[1][2][0] = std::numeric_limits<double>::infinity();
  std::ostringstream out;
  EXPECT_THROW(writeQueries(out, queries), std::invalid_argument);
}

TEST(QueryFile, ErrorsNameInputLineAndValue) {
  const std::string good = "1,1,1,1,1,1,0\n";
  struct Case {
    std::string line, value;
  };
  const Case cases[] = {{"1,1,1,1,1,1\n", "6"},
                        {"1,1,1,1,1,1,0,0\n", "8"},
                        {"1,1,1,x7,1,1,0\n", "'x7'"},
                        {"1,1,1,1.5,1,1,0\n", "'1.5'"},
                        {"1,1,1,,1,1,0\n", "''"},
                        {"1,1,-,1,1,1,0\n", "'-'"},
                        {"1,0,1,1,1,1,0\n", "'0'"},
                        {"1,3,1,1,1,1,0\n", "'1/3'"},
                        {"9007199254740993,1,1,1,1,1,0\n", "'9007199254740993/1'"},
                        {"1" + std::string(309, '0') + ",1,1,1,1,1,0\n", "no double equals"},
                        {"1,1,1,2" + std::string(400, '0') + ",1,1,0\n", "no double equals"},
                        {std::string(5000, '1') + ",1,1,1,1,1,0\n", "digits"},
                        {"1,1,1,1,1,1,2\n", "'2'"},
                        {"1,1,1,1,1,1,1\n", "differs"}};
  for (const Case& c : cases) {
    const std::string message = errorOf(repeated(good, 2) + c.line + repeated(good, 5));
    EXPECT_NE(message.find("input:3:"), std::string::npos) << c.line << " gives " << message;
    EXPECT_NE(message.find(c.value), std::string::npos) << c.line << " gives " << message;
    EXPECT_LT(message.size(), 200u) << "a message must stay readable";
  }
  EXPECT_NE(errorOf(repeated(good, 11)).find("3 lines instead of 8"), std::string::npos);
}

TEST(QueryFile, MissingFileAndFolderAreNamed) {
  const std::string text =
      test::said<std::runtime_error>([&] { readQueryFile("no/such/file.csv", PairKind::EDGE_EDGE); });
  EXPECT_NE(text.find("no/such/file.csv"), std::string::npos);
  EXPECT_THROW(findQueryFiles("no/such/folder"), std::runtime_error);
}

TEST(QueryFile, FindsFamiliesFromRootFamilyAndKindFolder) {
  TemporaryFolder folder;
  const std::vector<Query> one(1);
  for (const char* name : {"b/edge-edge/2.csv", "b/edge-edge/1.csv", "a/vertex-face/0.csv", "a/notes/0.csv",
                           "deep/c/vertex-face/0.csv", "a/vertex-face/readme.txt"}) {
    writeQueryFile((folder.path() / name).string(), one);
  }
  const std::vector<QueryFileEntry> all = findQueryFiles(folder.path().string());
  ASSERT_EQ(all.size(), 4u);
  EXPECT_EQ(all[0].family, "a");
  EXPECT_EQ(all[0].kind, PairKind::VERTEX_FACE);
  EXPECT_EQ(all[1].family, "b");
  EXPECT_EQ(all[1].kind, PairKind::EDGE_EDGE);
  EXPECT_EQ(fs::path(all[1].path).filename(), "1.csv");
  EXPECT_EQ(all[3].family, "deep/c");

  const std::vector<QueryFileEntry> family = findQueryFiles((folder.path() / "b/").string());
  ASSERT_EQ(family.size(), 2u);
  EXPECT_EQ(family[0].family, "b");
  const std::vector<QueryFileEntry> kind = findQueryFiles((folder.path() / "b" / "edge-edge").string());
  ASSERT_EQ(kind.size(), 2u);
  EXPECT_EQ(kind[0].family, "b");
}

}  // namespace
}  // namespace dccd
