// Expected contacts: marked, counted and no alarm, and nothing of them is left out. Which ones they are is held against
// the rule, pair by pair.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "dccd/assurance.h"
#include "support/said.h"
#include "unit/step/two_sheets.h"

namespace dccd {
namespace test {
namespace {

constexpr std::uint16_t UPPER = 0, LOWER = 1;

/// A sheet that falls through another one.
struct Falling : TwoSheets {
  explicit Falling(double from = 0.3, double to = -0.3) : TwoSheets(from, to) {}
  Falling& expect(const ExpectedPartner& a, const ExpectedPartner& b, const std::string& phase = "") {
    options.expected.push_back({{a, b}, phase});
    return *this;
  }
};

ExpectedPartner all(std::uint16_t body) { return {body, {}, ""}; }
ExpectedPartner only(std::uint16_t body, const std::vector<Index>& vertices) { return {body, vertices, ""}; }

std::string messageOf(const Falling& falling) {
  return said<std::invalid_argument>([&] { falling.answer(); }, "nothing was refused");
}

/// The vertices of one side of a contact between meshes.
std::set<Index> sideOf(const Contact& c, std::uint16_t body) {
  const std::size_t size = c.kind == PairKind::VERTEX_FACE ? 1 : 2;
  const auto first = c.vertex.begin(), middle = first + static_cast<std::ptrdiff_t>(size);
  return c.body[0] == body ? std::set<Index>(first, middle) : std::set<Index>(middle, c.vertex.end());
}

bool within(const std::set<Index>& some, const std::vector<Index>& all) {
  return std::all_of(some.begin(), some.end(),
                     [&](Index v) { return std::find(all.begin(), all.end(), v) != all.end(); });
}

TEST(ExpectedContacts, AreFoundListedCountedAndMarkedAndNoAlarm) {
  const Outcome plain = Falling().answer();
  ASSERT_GT(plain.total_contacts, 10u);
  EXPECT_EQ(plain.touching, Touching::NEW);
  EXPECT_EQ(plain.earliest_unexpected_toc, plain.earliest_toc);
  const Outcome outcome = Falling().expect(all(LOWER), all(UPPER)).answer();
  EXPECT_EQ(outcome.touching, Touching::EXPECTED);
  EXPECT_EQ(outcome.total_contacts, plain.total_contacts);
  EXPECT_EQ(outcome.counts.expected, plain.total_contacts);
  EXPECT_EQ(outcome.counts.unexpectedNew(), 0u);
  EXPECT_EQ(outcome.earliest_toc, plain.earliest_toc);
  EXPECT_TRUE(std::isinf(outcome.earliest_unexpected_toc));
  EXPECT_EQ(difference(outcome.contacts, plain.contacts), "") << "nothing of them changes but the mark";
  for (const Contact& contact : outcome.contacts) EXPECT_TRUE(contact.expected) << describe(contact);
  const Assurance assurance = assuranceOf(outcome);
  EXPECT_TRUE(assurance.proved);
  EXPECT_FALSE(assurance.clear()) << "an expected contact is a contact";
  EXPECT_EQ(describe(assurance), "proved, what touches is expected (expected: lower with upper)");
}

TEST(ExpectedContacts, WhatIsExpectedIsSaidWhereNothingTouches) {
  const Assurance assurance =
      assuranceOf(Falling(0.3, 0.2).expect(only(UPPER, {0, 1}), all(OBSTACLE_BODY), "carry").answer());
  EXPECT_TRUE(assurance.clear());
  EXPECT_EQ(describe(assurance),
            "proved, nothing touches (expected: upper (2 vertices) with the map in phase 'carry')");
  Falling named(0.3, 0.2);
  named.expect({UPPER, {0, 1}, "hem"}, {UPPER, {0, 1}, "hem"});
  EXPECT_EQ(assuranceOf(named.answer()).expected, std::vector<std::string>{"upper ('hem', 2 vertices) with itself"});
}

TEST(ExpectedContacts, AllThatTheExpectationNamesMustBeInIt) {
  const std::vector<Index> corner{0, 1, 4, 5}, under{0, 1, 2, 4, 5, 6};
  std::size_t seen = 0;
  const Outcome one_side = Falling().expect(only(UPPER, corner), all(LOWER)).answer();
  for (const Contact& c : one_side.contacts) {
    EXPECT_EQ(c.expected, within(sideOf(c, UPPER), corner)) << describe(c);
    seen += c.expected;
  }
  EXPECT_GT(seen, 0u);
  EXPECT_LT(seen, one_side.total_contacts);
  EXPECT_EQ(one_side.counts.expected, seen);
  EXPECT_EQ(one_side.touching, Touching::NEW) << "the others are an alarm";
  EXPECT_LE(one_side.earliest_toc, one_side.earliest_unexpected_toc);
  const Outcome both = Falling().expect(only(UPPER, corner), only(LOWER, under)).answer();
  for (const Contact& c : both.contacts) {
    EXPECT_EQ(c.expected, within(sideOf(c, UPPER), corner) && within(sideOf(c, LOWER), under)) << describe(c);
  }
  EXPECT_GT(both.counts.expected, 0u);
  EXPECT_LT(both.counts.expected, seen);
}

TEST(ExpectedContacts, AreTheSameForHoweverManyExpectations) {
  // Pairs of neighbouring vertices of the upper sheet, and of each the lower sheet's left or right half.
  const auto halfOf = [](bool right) {
    std::vector<Index> half;
    for (Index v = 0; v < 16; ++v) {
      if ((v % 4 >= 2) == right) half.push_back(v);
    }
    return half;
  };
  for (const std::size_t count : {31u, 32u, 33u, 64u, 100u}) {
    Falling falling;
    std::vector<std::pair<std::vector<Index>, bool>> wanted;
    for (std::size_t i = 0; i < count; ++i) {
      const auto v = static_cast<Index>(i + 1 < count ? 5 * i % 9 : 10);  // the last one is like no other
      wanted.push_back({{v, v + 1, static_cast<Index>((v + 4) % 16)}, i + 1 == count || i % 3 == 0});
      const ExpectedPartner upper = only(UPPER, wanted.back().first), lower = only(LOWER, halfOf(wanted.back().second));
      i % 2 == 0 ? falling.expect(upper, lower) : falling.expect(lower, upper);
    }
    const Outcome outcome = falling.answer();
    for (const Contact& c : outcome.contacts) {
      const bool by_one = std::any_of(wanted.begin(), wanted.end(), [&](const auto& one) {
        return within(sideOf(c, UPPER), one.first) && within(sideOf(c, LOWER), halfOf(one.second));
      });
      ASSERT_EQ(c.expected, by_one) << count << " expectations: " << describe(c);
    }
    EXPECT_LT(outcome.counts.expected, outcome.contacts.size()) << count;
    falling.options.expected.pop_back();
    EXPECT_GT(outcome.counts.expected, falling.answer().counts.expected) << count;
  }
}

/// A strip that is folded onto itself: its ends meet.
TEST(ExpectedContacts, OfABodyWithItselfEitherSideMayComeFirst) {
  Falling falling;
  falling.step.bodies.resize(1);
  Positions flat, folded;
  for (int i = 0; i < 16; ++i) {
    const double x = 0.1 * (i % 4), y = 0.1 * (i / 4) + 0.003 * (i % 4);
    flat.push_back({x, y, i % 4 == 3 ? 0.1 : 0});
    folded.push_back({i % 4 == 3 ? 0.05 : x, y + (i % 4 == 3 ? 0.02 : 0), i % 4 == 3 ? -0.1 : 0});
  }
  falling.step.bodies[0] = moving(falling.step.bodies[0], flat, folded);
  const std::vector<Index> edge{3, 7, 11, 15}, rest{0, 1, 2, 4, 5, 6, 8, 9, 10, 12, 13, 14};
  const Outcome plain = falling.answer();
  ASSERT_GT(plain.total_contacts, 0u);
  const Outcome outcome = Falling(falling).expect(only(UPPER, edge), only(UPPER, rest)).answer();
  const Outcome turned = Falling(falling).expect(only(UPPER, rest), only(UPPER, edge)).answer();
  for (std::size_t i = 0; i < outcome.contacts.size(); ++i) {
    const Contact& c = outcome.contacts[i];
    const auto first = c.vertex.begin(), middle = first + (c.kind == PairKind::VERTEX_FACE ? 1 : 2);
    const std::set<Index> a(first, middle), b(middle, c.vertex.end());
    EXPECT_EQ(c.expected, (within(a, edge) && within(b, rest)) || (within(b, edge) && within(a, rest))) << describe(c);
    EXPECT_EQ(c.expected, turned.contacts[i].expected) << describe(c);
  }
  EXPECT_GT(outcome.counts.expected, 0u);
  EXPECT_EQ(Falling(falling).expect(all(UPPER), all(UPPER)).answer().touching, Touching::EXPECTED);
}

TEST(ExpectedContacts, TouchingTellsFourThingsApart) {
  // One on the other: they meet when the step begins.
  EXPECT_EQ(Falling(0, 0).answer().touching, Touching::LASTING);
  const Outcome resting = Falling(0, 0).expect(all(UPPER), all(LOWER)).answer();
  EXPECT_EQ(resting.touching, Touching::EXPECTED);
  EXPECT_EQ(resting.counts.expected_initial, resting.counts.initial);
  EXPECT_EQ(Falling(0, 0).expect(only(UPPER, {0, 1}), all(LOWER)).answer().touching, Touching::LASTING)
      << "something unexpected lasts";
  EXPECT_EQ(Falling(0.3, 0.2).expect(all(UPPER), all(LOWER)).answer().touching, Touching::NONE);
}

TEST(ExpectedContacts, WhatCrossesAtTheStartIsExpectedAsWell) {
  Falling falling;
  Positions tilted = sheetAt(0);
  for (Vec3& x : tilted) x.z() += 0.2 * (x.x() - 0.15);
  falling.step.bodies[UPPER].t0 = falling.step.bodies[UPPER].t1 = share(tilted);
  const Outcome plain = falling.answer();
  ASSERT_FALSE(plain.intersections.empty());
  EXPECT_NE(plain.touching, Touching::EXPECTED);
  const Outcome outcome = Falling(falling).expect(all(UPPER), all(LOWER)).answer();
  EXPECT_EQ(outcome.start_state, StartState::INTERSECTING) << "it is so, expected or not";
  EXPECT_EQ(outcome.intersections.size(), plain.intersections.size());
  for (const StartIntersection& one : outcome.intersections) EXPECT_TRUE(one.expected);
  EXPECT_EQ(outcome.touching, Touching::EXPECTED);
  const Outcome some = Falling(falling).expect(only(UPPER, {0, 1, 2, 4, 5, 6}), all(LOWER)).answer();
  for (const StartIntersection& one : some.intersections) {
    const std::size_t edge = one.body[0] == UPPER ? 0 : 2;
    const std::set<Index> side(one.vertex.begin() + edge, one.vertex.begin() + (edge == 0 ? 2 : 5));
    EXPECT_EQ(one.expected, within(side, {0, 1, 2, 4, 5, 6}));
  }
  EXPECT_NE(some.touching, Touching::EXPECTED);
}

/// Of a body inside of another one only the piece's first vertex is told, so that a set cannot hold all of it.
TEST(ExpectedContacts, ABodyInsideOfAnotherIsExpectedWithoutSetsOnly) {
  Falling falling;
  const Positions big{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {0, 0, 4}};
  Positions small = big;
  for (Vec3& x : small) x = 0.1 * x + Vec3(0.5, 0.5, 0.5);
  const auto solid = share(Topology::fromTriangles(4, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}));
  for (Body& body : falling.step.bodies) body.topology = solid;
  falling.step.bodies[UPPER] = moving(falling.step.bodies[UPPER], small, small);
  falling.step.bodies[LOWER] = moving(falling.step.bodies[LOWER], big, big);
  ASSERT_EQ(falling.answer().touching, Touching::LASTING);
  EXPECT_EQ(Falling(falling).expect(all(UPPER), all(LOWER)).answer().touching, Touching::EXPECTED);
  EXPECT_EQ(Falling(falling).expect(only(UPPER, {0, 1, 2, 3}), all(LOWER)).answer().touching, Touching::LASTING);
  EXPECT_EQ(Falling(falling).expect(all(UPPER), only(LOWER, {0, 1, 2, 3})).answer().touching, Touching::LASTING);
}

/// The sheet over one voxel under its corner.
TEST(ExpectedContacts, TheMapIsAPartnerAndItsSuppressedContactsKeepTheirMark) {
  Falling falling(0.3, -0.3);
  falling.step.bodies.resize(1);
  falling.step.map.surface = VoxelSurface::build(0.1, {voxelAt(0, 0, 0)});
  ASSERT_EQ(falling.answer().touching, Touching::NEW);
  const Outcome outcome = Falling(falling).expect(all(UPPER), all(OBSTACLE_BODY)).answer();
  EXPECT_EQ(outcome.touching, Touching::EXPECTED);
  EXPECT_EQ(outcome.counts.expected, outcome.counts.obstacle);
  const Outcome corner = Falling(falling).expect(only(UPPER, {0, 1, 4, 5}), all(OBSTACLE_BODY)).answer();
  for (const Contact& c : corner.contacts) {
    const bool inside = std::all_of(c.vertex.begin(), c.vertex.end(), [](Index v) {
      return v == NO_INDEX || within({v}, {0, 1, 4, 5});
    });
    EXPECT_EQ(c.expected, inside) << describe(c);
  }
  Falling inside(0.05, 0.06);
  inside.step.bodies.resize(1);
  inside.step.map = falling.step.map;
  inside.options.suppress_initial = true;
  const Outcome suppressed = inside.answer();
  ASSERT_GT(suppressed.suppressed, 0u);
  EXPECT_EQ(suppressed.touching, Touching::LASTING);
  EXPECT_EQ(inside.expect(all(UPPER), all(OBSTACLE_BODY)).answer().touching, Touching::EXPECTED);
}

TEST(ExpectedContacts, DoNotCrowdAnAlarmOutOfTheList) {
  Falling falling;
  falling.expect(only(UPPER, {0, 1, 2, 3, 4, 5, 6, 7}), all(LOWER));
  const Outcome whole = falling.answer();
  const std::size_t unexpected = whole.total_contacts - whole.counts.expected;
  ASSERT_GT(unexpected, 1u);
  ASSERT_GT(whole.counts.expected, 1u);
  falling.options.max_contacts = unexpected;
  const Outcome cut = falling.answer();
  EXPECT_EQ(cut.contacts.size(), unexpected);
  for (const Contact& contact : cut.contacts) EXPECT_FALSE(contact.expected);
  EXPECT_EQ(cut.counts.expected, whole.counts.expected);
  EXPECT_EQ(cut.earliest_unexpected_toc, whole.earliest_unexpected_toc);
}

TEST(ExpectedContacts, ChangeFromStepToStep) {
  Falling falling;
  Detector detector(falling.options);
  EXPECT_EQ(detector.run(falling.step).touching, Touching::NEW);
  falling.expect(all(UPPER), all(LOWER));
  detector.setOptions(falling.options);
  EXPECT_EQ(detector.run(falling.step).touching, Touching::EXPECTED);
  // Another mesh, for which the set is another one.
  falling.options.expected = {{{only(UPPER, {3}), all(LOWER)}, ""}};
  detector.setOptions(falling.options);
  EXPECT_EQ(detector.run(falling.step).touching, Touching::NEW);
  falling.step.bodies[UPPER].topology = share(Topology::grid(2, 8));
  EXPECT_EQ(detector.run(falling.step).touching, Touching::NEW);
}

TEST(ExpectedContacts, WhatCannotBeIsRefusedByName) {
  EXPECT_EQ(messageOf(Falling().expect(all(UPPER), all(7))), "expected[0]: partner 1 is body 7 of 2");
  EXPECT_EQ(messageOf(Falling().expect(all(OBSTACLE_BODY), all(UPPER))),
            "expected[0]: partner 0 is the map; it comes second");
  EXPECT_EQ(messageOf(Falling().expect(all(UPPER), only(OBSTACLE_BODY, {1}))),
            "expected[0]: partner 1 is the map, which has no vertices");
  EXPECT_EQ(messageOf(Falling().expect(only(UPPER, {3, 16}), all(LOWER))),
            "expected contacts of body 'upper' name vertex 16, but the mesh has 16");
  Falling earliest;
  earliest.options.earliest_only = true;
  EXPECT_NE(messageOf(earliest.expect(all(UPPER), all(LOWER))).find("earliest_only"), std::string::npos);
}

}  // namespace
}  // namespace test
}  // namespace dccd
