// The real scenes through the whole detector, and the filters of the step on every pair with known truth.
#include <gtest/gtest.h>
#include <hwy/aligned_allocator.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>
#include <set>
#include <tuple>

#include "culling/toc_bound.h"
#include "oracle/algebraic.h"
#include "oracle/query_file.h"
#include "simd/fused_filter.h"
#include "simd/group_pairs.h"
#include "support/data.h"
#include "support/pair_list.h"
#include "support/patch_oracle.h"
#include "support/scene_data.h"
#include "support/step_support.h"
#include "support/step_truth.h"

namespace dccd {
namespace test {
namespace {

using Pair = std::tuple<PairKind, Index, Index, Index, Index>;

/// Faces by their set of vertices; edges with the smaller index first, the smaller edge first.
Pair canonical(PairKind kind, std::array<Index, 4> v) {
  if (kind == PairKind::VERTEX_FACE) {
    std::sort(v.begin() + 1, v.end());
  } else {
    if (v[0] > v[1]) std::swap(v[0], v[1]);
    if (v[2] > v[3]) std::swap(v[2], v[3]);
    if (std::tie(v[2], v[3]) < std::tie(v[0], v[1])) std::swap_ranges(v.begin(), v.begin() + 2, v.begin() + 2);
  }
  return {kind, v[0], v[1], v[2], v[3]};
}

struct Scene {
  SceneData data;
  Positions t0, t1;
  std::set<Pair> contacts;

  explicit Scene(const std::string& name) : data(readScene(name)) {
    for (const VertexMotion& v : data.vertices) {
      t0.emplace_back(v.t0[0], v.t0[1], v.t0[2]);
      t1.emplace_back(v.t1[0], v.t1[1], v.t1[2]);
    }
    for (const TruthPair& p : data.vertex_face) {
      if (p.contact) contacts.insert(canonical(PairKind::VERTEX_FACE, p.pair));
    }
    for (const TruthPair& p : data.edge_edge) {
      if (p.contact) contacts.insert(canonical(PairKind::EDGE_EDGE, p.pair));
    }
  }

  Outcome run(const Options& options) const { return Detector(options).run(step(t0, t1)); }
  Step step(const Positions& from, const Positions& to) const {
    Body setup;
    setup.name = "mesh";
    setup.topology = std::make_shared<Topology>(Topology::fromTriangles(t0.size(), data.faces));
    return stepOf(setup, from, to);
  }
};

class StepScenes : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override { DEFORMABLE_CCD_REQUIRE_DATA(); }
};

std::set<Pair> pairsOf(const Outcome& result) {
  std::set<Pair> pairs;
  for (const Contact& c : result.contacts) pairs.insert(canonical(c.kind, c.vertex));
  EXPECT_EQ(pairs.size(), result.contacts.size()) << "a pair is reported twice";
  return pairs;
}

std::size_t missing(const std::set<Pair>& from, const std::set<Pair>& wanted) {
  return static_cast<std::size_t>(
      std::count_if(wanted.begin(), wanted.end(), [&](const Pair& p) { return from.count(p) == 0; }));
}

TEST_P(StepScenes, ExactGivesExactlyTheTruth) {
  const Scene scene(GetParam());
  Options options;
  options.num_threads = 2;
  const Outcome result = scene.run(options);
  const std::set<Pair> found = pairsOf(result);
  EXPECT_TRUE(result.complete);
  EXPECT_EQ(result.stats.undecided, 0u);
  EXPECT_EQ(missing(found, scene.contacts), 0u);
  EXPECT_EQ(missing(scene.contacts, found), 0u) << "contacts that are none";
  EXPECT_TRUE(std::is_sorted(result.contacts.begin(), result.contacts.end(), canonicalLess));
  std::cout << GetParam() << ": " << found.size() << " contacts, " << scene.contacts.size() << " in truth; "
            << toString(result.start_state) << " with " << result.intersections.size() << " pairs\n";
}

TEST_P(StepScenes, ConservativeMissesNothing) {
  const Scene scene(GetParam());
  Options options;
  options.accuracy.rung = Accuracy::CONSERVATIVE;
  options.check_start_state = false;
  const std::set<Pair> found = pairsOf(scene.run(options));
  EXPECT_EQ(missing(found, scene.contacts), 0u);
  std::cout << GetParam() << ", conservative: " << found.size() << " for " << scene.contacts.size() << '\n';
}

// Carried over from step to step, back and forth between the two frames, the start state is that of the full test.
TEST_P(StepScenes, StartStateIsCarriedOver) {
  const Scene scene(GetParam());
  Options options;
  Detector carrying(options), full(options);
  for (int i = 0; i < 3; ++i) {
    const Step step = i % 2 == 0 ? scene.step(scene.t0, scene.t1) : scene.step(scene.t1, scene.t0);
    const auto carried = carrying.run(step).intersections;
    full.history().clear();
    const auto expected = full.run(step).intersections;
    EXPECT_TRUE(std::equal(carried.begin(), carried.end(), expected.begin(), expected.end(),
                           [](const auto& x, const auto& y) { return x == y; }))
        << carried.size() << " carried over, " << expected.size() << " by the full test";
    const Positions& x = *step.bodies[0].t0;
    for (std::size_t k = 0; k < expected.size(); k += 211) {  // the oracle is slow
      const auto& v = expected[k].vertex;
      EXPECT_TRUE(trulyMeet(x[v[0]], x[v[1]], x[v[2]], x[v[3]], x[v[4]])) << "pair " << k << " does not meet";
    }
  }
}

TEST_P(StepScenes, PatchesAreThoseOfTheDefinition) {
  const Scene scene(GetParam());
  Options options;
  options.patches = true;
  const Outcome one = scene.run(options);
  EXPECT_EQ(patchProblem(one), "");
  for (const int threads : {2, 3}) {
    options.num_threads = threads;
    EXPECT_EQ(patchDifference(one, scene.run(options)), "") << threads << " threads";
  }
  std::cout << GetParam() << ": " << one.contacts.size() << " contacts in " << one.patches.size() << " patches\n";
}

INSTANTIATE_TEST_SUITE_P(Truth, StepScenes, testing::Values("cloth-ball", "n-body"), [](const auto& info) {
  std::string name = info.param;
  name.erase(std::remove(name.begin(), name.end(), '-'), name.end());
  return name;
});

// --- times of contact that others found symbolically -----------------------------------------------------------------

/// What `decimal` stands for, exactly: digits, or digits, a point and digits.
Rational rationalOf(const std::string& decimal) {
  const std::size_t point = std::min(decimal.find('.'), decimal.size());
  std::string digits = decimal.substr(0, point);
  const std::string fraction = decimal.substr(std::min(point + 1, decimal.size()));
  digits += fraction;
  digits.erase(0, std::min(digits.find_first_not_of('0'), digits.size() - 1));  // a leading zero would mean octal
  return Rational(Integer(digits), pow(Integer(10), static_cast<unsigned>(fraction.size())));
}

/// The cells that hold given times, and how many of the contacts found lie in theirs.
class ContactTimes {
 public:
  explicit ContactTimes(const std::vector<TruthTime>& times) {
    for (const TruthTime& time : times) {
      const Rational t = rationalOf(time.decimal);
      const Integer finest = numerator(t) * (Integer(1) << FINEST) / denominator(t);  // not negative: rounded down
      finest_[canonical(PairKind::VERTEX_FACE, time.pair)] = static_cast<std::int64_t>(finest);
    }
  }
  std::size_t size() const { return finest_.size(); }

  struct Tally {
    std::size_t compared = 0;  ///< contacts whose time is known
    std::size_t in_cell = 0;   ///< of those, the ones whose interval is the cell of 2^-bits that holds it
    std::size_t beside = 0;    ///< the ones whose interval is that of a neighbouring cell
  };
  Tally compare(const std::vector<Contact>& contacts, int bits) const {
    Tally tally;
    const double width = std::ldexp(1.0, -bits);
    for (const Contact& contact : contacts) {
      const auto known = finest_.find(canonical(contact.kind, contact.vertex));
      if (known == finest_.end()) continue;
      ++tally.compared;
      const auto isCell = [&](std::int64_t cell) {
        const double lower = static_cast<double>(cell) * width;  // exact: at most 52 bits
        return contact.toc_lower == lower && contact.toc_upper == std::min(1.0, lower + width);
      };
      const std::int64_t cell = known->second >> (FINEST - bits);
      tally.in_cell += isCell(cell);
      tally.beside += isCell(cell - 1) || isCell(cell + 1);
    }
    return tally;
  }

 private:
  static constexpr int FINEST = 52;
  std::map<Pair, std::int64_t> finest_;  // the time in units of 2^-FINEST, rounded down
};

TEST(StepTimes, ExactCellsHoldAllTimesThatWereFoundSymbolically) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  const std::string path = dataDir() + "/scenes/n-body/toc_vf.txt.gz";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no times of contact: there is no " << path;
  constexpr std::size_t KNOWN = 9459;  // what the data set says that it holds
  const std::vector<TruthTime> list = readTruthTimes(path);
  const ContactTimes times(list);
  ASSERT_EQ(list.size(), KNOWN);
  ASSERT_EQ(times.size(), KNOWN) << "a pair stands twice in the list";

  const Scene scene("n-body");
  for (const TruthTime& time : list) {
    ASSERT_EQ(scene.contacts.count(canonical(PairKind::VERTEX_FACE, time.pair)), 1u) << "no contact by vf.txt.gz";
  }
  std::size_t comparisons = 0;
  forEachSimdTarget([&](const std::string& target) {
    for (const int bits : {10, 32, 52}) {
      Options options;
      options.accuracy.toc_bits = bits;
      options.check_start_state = false;
      const Outcome result = scene.run(options);
      const ContactTimes::Tally tally = times.compare(result.contacts, bits);
      EXPECT_EQ(tally.compared, KNOWN) << target << ", " << bits << " bits";
      EXPECT_EQ(tally.in_cell, KNOWN) << target << ", " << bits << " bits; one cell off: " << tally.beside;
      comparisons += tally.compared;
    }
  });
  std::cout << KNOWN << " times, " << comparisons << " comparisons\n";
}

// That a cell is held against the time, digit for digit, and not against something coarser.
TEST(StepTimes, ATimeOutsideOfItsCellIsSeen) {
  Contact contact;
  contact.vertex = {7, 1, 2, 3};
  const auto inCell = [&](const std::string& decimal, double lower, int bits) {
    contact.toc_lower = lower;
    contact.toc_upper = std::min(1.0, lower + std::ldexp(1.0, -bits));
    const ContactTimes::Tally tally = ContactTimes({{{7, 3, 1, 2}, decimal}}).compare({contact}, bits);
    EXPECT_EQ(tally.compared, 1u);
    return tally.in_cell == 1;
  };
  EXPECT_TRUE(inCell("0.5", 0.5, 52));
  EXPECT_FALSE(inCell("0.4999999999999999999999999999999999999999999999999", 0.5, 52));
  EXPECT_TRUE(inCell("0.4999999999999999999999999999999999999999999999999", 0.5 - 0x1p-52, 52));
  EXPECT_TRUE(inCell("0.0009765624999999999999999999999999999999999999999", 0, 10));
  EXPECT_FALSE(inCell("0.0009765625", 0, 10)) << "the upper end is not in the cell";
  EXPECT_TRUE(inCell("0.0", 0, 32));
  EXPECT_TRUE(inCell("1", 1, 32));
  EXPECT_FALSE(inCell("1.0", 1 - 0x1p-32, 32));
  contact.vertex = {8, 1, 2, 3};
  EXPECT_EQ(ContactTimes({{{7, 3, 1, 2}, "0.5"}}).compare({contact}, 52).compared, 0u);
}

// --- the filters of the step on single pairs -------------------------------------------------------------------------

void expectFusedKeepsAll(const PairList& truth, const std::string& what) {
  std::vector<std::uint32_t> kept(truth.pairs.size());
  for (const simd::FusedPlanes planes :
       {simd::FusedPlanes::COORDINATE, simd::FusedPlanes::ADAPTIVE, simd::FusedPlanes::ALL}) {
    EXPECT_EQ(simd::fusedFilter(truth.vertices[0].t0, truth.pairs[0].data(), truth.pairs.size(),
                                truth.kind == PairKind::EDGE_EDGE, planes, kept.data()),
              truth.pairs.size())
        << what;
  }
}

/// Each pair as two groups of one feature, with records over the range of `vertices`.
void expectLinearKeepsAll(const PairList& truth, const std::string& what) {
  double low[8], high[8], scale[8];
  std::fill_n(low, 8, HUGE_VAL);
  std::fill_n(high, 8, -HUGE_VAL);
  simd::projectionBounds(truth.vertices[0].t0, truth.vertices.size(), low, high);
  for (int d = 0; d < 8; ++d) scale[d] = high[d] > low[d] ? simd::RECORD_RANGE / (high[d] - low[d]) : 0;
  std::vector<std::uint16_t> records(truth.vertices.size() * simd::RECORD);
  simd::quantize(truth.vertices[0].t0, truth.vertices.size(), low, scale, records.data());
  auto soa = hwy::AllocateAligned<std::uint16_t>(2 * simd::SOA_SIZE);
  auto aos = hwy::AllocateAligned<std::uint16_t>(2 * simd::AOS_SIZE);
  const std::size_t first = truth.kind == PairKind::VERTEX_FACE ? 1 : 2;
  for (const Quad& quad : truth.pairs) {
    for (std::size_t side = 0; side < 2; ++side) {
      const std::size_t arity = side == 0 ? first : 4 - first;
      std::vector<std::uint32_t> lanes(simd::GROUP * arity, UINT32_MAX);
      std::copy_n(quad.begin() + (side == 0 ? 0 : first), arity, lanes.begin());
      simd::buildLeaves(records.data(), lanes.data(), arity, simd::GROUP, nullptr, soa.get() + side * simd::SOA_SIZE,
                        aos.get() + side * simd::AOS_SIZE);
    }
    const std::uint32_t groups[2] = {0, 1};
    std::uint32_t out[512];
    std::size_t consumed = 0;
    const simd::GroupsView view{soa.get(), aos.get()};
    ASSERT_EQ(simd::testGroupPairs(view, view, groups, 1, false, simd::Diagonal::ALL, false, out, 256, &consumed), 1u)
        << what << ": the linear filter culls a true contact";
  }
}

void expectBoundsHold(const PairList& truth, const std::string& what) {
  for (const Quad& quad : truth.pairs) {
    const double bound = linearTocBound(truth.kind, truth.vertices.data(), quad, 0);
    ASSERT_GE(bound, 0) << what;
    ASSERT_LE(bound, 1) << what << ": a true contact is said never to be";
  }
}

TEST(StepFilters, CullNoTrueContactOfTheQueries) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  std::size_t count = 0;
  for (const QueryFileEntry& file : findQueryFiles(dataDir() + "/ccd_queries")) {
    PairList truth(file.kind);
    for (const Query& query : readQueryFile(file.path, file.kind)) {
      if (query.contact) truth.add(query.motion);
    }
    if (truth.pairs.empty()) continue;
    count += truth.pairs.size();
    forEachSimdTarget([&](const std::string& target) {
      expectFusedKeepsAll(truth, target + ", " + file.path);
      expectLinearKeepsAll(truth, target + ", " + file.path);
    });
    expectBoundsHold(truth, file.path);
  }
  std::cout << count << " queries in contact\n";
  EXPECT_GT(count, 200u);
}

TEST(StepFilters, CullNoTrueContactOfTheScenes) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  for (const char* name : {"cloth-ball", "n-body"}) {
    const SceneData scene = readScene(name);
    for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
      PairList truth(kind);
      truth.vertices = scene.vertices;
      for (const TruthPair& p : kind == PairKind::VERTEX_FACE ? scene.vertex_face : scene.edge_edge) {
        if (p.contact) truth.pairs.push_back(p.pair);
      }
      forEachSimdTarget([&](const std::string& target) { expectFusedKeepsAll(truth, target + ", " + name); });
      expectLinearKeepsAll(truth, name);
      expectBoundsHold(truth, name);
    }
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
