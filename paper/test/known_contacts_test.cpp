#include "paper/known_contacts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <string>

namespace dccd {
namespace test {
namespace {

Contact contact(PairKind kind, std::array<Index, 4> vertices, double lower, double upper,
                Certainty certainty = Certainty::CERTAIN) {
  Contact c;
  c.kind = kind;
  c.vertex = vertices;
  c.toc_lower = lower;
  c.toc_upper = upper;
  c.certainty = certainty;
  return c;
}

Outcome answer(std::vector<Contact> contacts) {
  Outcome outcome;
  outcome.answered = true;
  outcome.contacts = std::move(contacts);
  return outcome;
}

struct TruthFile {
  const std::string path = testing::TempDir() + "known_contacts.txt";
  explicit TruthFile(const std::string& text) { std::ofstream(path) << text; }
  ~TruthFile() { std::remove(path.c_str()); }
  std::string refusal() const {
    try {
      KnownContacts::fromFile(path);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }
};

TEST(KnownContacts, PairsAreTheSameWhicheverWayRoundTheyAreGiven) {
  using K = KnownContacts;
  EXPECT_EQ(K::pairOf(PairKind::VERTEX_FACE, {9, 3, 1, 2}), K::pairOf(PairKind::VERTEX_FACE, {9, 2, 3, 1}));
  EXPECT_NE(K::pairOf(PairKind::VERTEX_FACE, {9, 3, 1, 2}), K::pairOf(PairKind::VERTEX_FACE, {3, 9, 1, 2}));
  EXPECT_EQ(K::pairOf(PairKind::EDGE_EDGE, {9, 3, 1, 2}), K::pairOf(PairKind::EDGE_EDGE, {2, 1, 3, 9}));
  EXPECT_NE(K::pairOf(PairKind::EDGE_EDGE, {9, 3, 1, 2}), K::pairOf(PairKind::EDGE_EDGE, {9, 1, 3, 2}));
}

TEST(KnownContacts, AFileOfPairsWithAndWithoutTimes) {
  const TruthFile file(
      "# others' truth\nkind,v0,v1,v2,v3,toc_lower,toc_upper\nVF 7 1 2 3\nEE,1,2,8,9,0.25\nVF 7 3 2 1 0.5\n"
      "EE 4 5 6 7 0.25 0.75\n");
  const KnownContacts known = KnownContacts::fromFile(file.path);
  EXPECT_EQ(known.size(), 3u);
  const auto vf = known.timeOf(KnownContacts::pairOf(PairKind::VERTEX_FACE, {7, 2, 1, 3}));
  ASSERT_TRUE(vf);
  EXPECT_EQ(vf->lower, 0.5);
  EXPECT_EQ(vf->upper, 0.5);
  EXPECT_EQ(known.timeOf(KnownContacts::pairOf(PairKind::EDGE_EDGE, {6, 7, 4, 5}))->upper, 0.75);
  EXPECT_FALSE(known.holds(KnownContacts::pairOf(PairKind::EDGE_EDGE, {7, 1, 2, 3})));
}

TEST(KnownContacts, ABadFileIsRefusedWithTheLine) {
  EXPECT_NE(TruthFile("VF 1 2 3 4\nFV 1 2 3 4\n").refusal().find("line 2: 'FV'"), std::string::npos);
  EXPECT_NE(TruthFile("VF 1 2 3\n").refusal().find("four vertices"), std::string::npos);
  EXPECT_NE(TruthFile("VF 1 2 3 -4\n").refusal().find("line 1"), std::string::npos);
  EXPECT_NE(TruthFile("EE 1 2 3 4 0.7 0.2\n").refusal().find("earlier end first"), std::string::npos);
  EXPECT_NE(TruthFile("EE 1 2 3 4 nan\n").refusal().find("line 1"), std::string::npos);
  EXPECT_NE(TruthFile("EE 1 2 3 4 1.5\n").refusal().find("between 0 and 1"), std::string::npos);
  EXPECT_NE(TruthFile("# nothing\n").refusal().find("no contact"), std::string::npos);
  EXPECT_THROW(KnownContacts::fromFile("/nowhere/at/all"), std::runtime_error);
}

TEST(AccuracyErrors, MissedFalseUndecidedAndTheErrorOfEitherEnd) {
  const Outcome finest = answer({contact(PairKind::VERTEX_FACE, {7, 1, 2, 3}, 0.5, 0.5),
                                 contact(PairKind::EDGE_EDGE, {1, 2, 8, 9}, 0.25, 0.25),
                                 contact(PairKind::EDGE_EDGE, {4, 5, 6, 7}, 0.75, 0.75)});
  const KnownContacts cells = KnownContacts::fromOutcome(finest);
  const TruthFile file("VF 7 1 2 3 0.5\nEE 1 2 8 9\nEE 4 5 6 7\n");
  const KnownContacts truth = KnownContacts::fromFile(file.path);
  const Outcome tried = answer({contact(PairKind::VERTEX_FACE, {7, 2, 1, 3}, 0.375, 0.5),  // early by 1/8
                                contact(PairKind::EDGE_EDGE, {1, 2, 8, 9}, 0.25, 0.5),     // its end late by 1/4
                                contact(PairKind::EDGE_EDGE, {1, 3, 8, 9}, 0.1, 0.9),      // there is none
                                contact(PairKind::EDGE_EDGE, {1, 4, 8, 9}, 0, 1, Certainty::UNDECIDED)});
  const AccuracyErrors errors = errorsOf(tried, truth, cells);
  EXPECT_EQ(errors.missed, 1u);
  EXPECT_EQ(errors.false_contacts, 1u);
  EXPECT_EQ(errors.undecided, 1u);
  EXPECT_EQ(errors.timed_by_truth, 1u);
  EXPECT_EQ(errors.toc_error, 0.25);
  EXPECT_EQ(errorsOf(finest, truth, cells).toc_error, 0);
}

TEST(AccuracyErrors, TheWidthOfTheCellsCounts) {
  EXPECT_EQ(dccd::tocError({0.25, 0.5}, {0.25, 0.5}), 0.25) << "the time may be at the other end";
  EXPECT_EQ(dccd::tocError({0, 1}, {0.25, 0.25}), 0.75);
  EXPECT_EQ(dccd::tocError({0.5, 0.5}, {0.25, 0.375}), 0.25);
}

TEST(MedianOf, OrderStatisticsOfKnownValues) {
  std::vector<double> values;
  for (int i = 100; i >= 1; --i) values.push_back(i);
  const MedianInterval all = medianOf(values);
  EXPECT_EQ(all.median, 50.5);
  EXPECT_EQ(all.low, 40);  // the 40th and the 61st of 100: binomial(100, 1/2) leaves 2.8 % beyond either
  EXPECT_EQ(all.high, 61);
  const MedianInterval few = medianOf({3, 1, 2});
  EXPECT_EQ(few.low, 1);
  EXPECT_EQ(few.median, 2);
  EXPECT_EQ(few.high, 3);
}

}  // namespace
}  // namespace test
}  // namespace dccd
