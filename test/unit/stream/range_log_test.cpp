// A stream that is cut anywhere and joined is the stream: contacts, counters of pairs, identities, events, predictions.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "dccd/range_log.h"
#include "dccd/stream.h"

namespace dccd {
namespace test {
namespace {

constexpr std::uint64_t FRAMES = 48, NO_MAP = 10, GAP = 20, MAP = 30, LIFTED = 42;
constexpr double HORIZON_S = 0.1;
const double GAPS_S[] = {0, 0.1};  // of patches: what comes apart is two at once, or later

std::shared_ptr<const VoxelSurface> table() {
  std::vector<OccupiedLeaf> leaves;
  for (int x = -12; x < 24; ++x) {
    for (int y = -12; y < 24; ++y) {
      leaves.push_back(
          {{static_cast<std::uint16_t>(32768 + x), static_cast<std::uint16_t>(32768 + y), std::uint16_t{32767}}, 1});
    }
  }
  return VoxelSurface::build(0.05, leaves);
}

constexpr std::size_t ROWS = 6, COLS = 12;

/// Waves that dip into the table and into the body that rests beside it, one that folds over itself.
Positions cloth(std::uint64_t frame) {
  Positions x;
  const double t = 0.35 * static_cast<double>(frame);
  for (std::size_t r = 0; r < ROWS; ++r) {
    for (std::size_t c = 0; c < COLS; ++c) {
      const double u = static_cast<double>(c), v = static_cast<double>(r);
      x.emplace_back(0.05 * u + 0.08 * std::sin(t + 0.9 * u) + 0.003, 0.05 * v + 0.004,
                     0.06 + 0.09 * std::sin(t + 0.6 * u + 0.2 * v));
    }
  }
  return x;
}

Positions resting() {
  Positions x;
  for (std::size_t r = 0; r < ROWS; ++r) {
    for (std::size_t c = 0; c < COLS; ++c) {
      x.emplace_back(0.021 + 0.05 * static_cast<double>(c), 0.012 + 0.05 * static_cast<double>(r), 0.051);
    }
  }
  return x;
}

/// All of an outcome that does not depend on who follows its patches, in words; bits of doubles as they are.
std::string describe(const Outcome& o) {
  std::ostringstream text;
  text << std::hexfloat << o.sequence << ' ' << toString(o.status) << ' ' << toString(o.start_state) << ' '
       << o.intersections.size();
  for (const Contact& c : o.contacts) {
    text << ' ' << static_cast<int>(c.kind) << ':' << c.vertex[0] << ',' << c.vertex[1] << ',' << c.vertex[2] << ','
         << c.toc_lower << '-' << c.toc_upper << c.initial;
  }
  for (const Stage stage : {Stage::BROAD_PHASE, Stage::PLANAR, Stage::ELEMENTARY, Stage::OBSTACLE}) {
    text << ' ' << o.stats[stage].in << '>' << o.stats[stage].out;
  }
  return text.str();
}

std::string describePatches(const Outcome& o) {
  std::ostringstream text;
  text << std::hexfloat << o.sequence << ':';
  for (const Patch& p : o.patches) {
    text << ' ' << p.id << '/' << p.contacts << '/' << p.is_new << '/' << toString(p.beginning) << '/'
         << p.centroid.x();
  }
  for (const PatchEvent& e : o.patch_events) {
    text << ' ' << toString(e.kind) << e.id << '@' << e.from_ns << '-' << e.to_ns;
    for (const std::uint64_t other : e.others) text << '+' << other;
  }
  return text.str();
}

struct Told {
  std::vector<std::string> answers, patches;
  std::optional<LookAheadSummary> score;
};

/// The whole stream; only what the log's range holds is told.
Told stream(RangeLog* log, double gap_s) {
  MonitorOptions options;
  options.detector.patches = true;
  options.look_ahead_s = HORIZON_S;
  options.patch_gap_s = gap_s;
  std::vector<Body> bodies(2);
  bodies[0].name = "cloth";
  bodies[1].name = "resting";
  Monitor monitor(options, bodies);
  if (log) monitor.computeOnly(*log);
  const auto topology = std::make_shared<const Topology>(Topology::grid(ROWS, COLS));
  const auto surface = table();
  LookAheadScore score(HORIZON_S);
  Told told;
  StampNs stamp_ns = 1000000000;
  for (std::uint64_t frame = 1; frame <= FRAMES; ++frame) {
    stamp_ns += frame == GAP ? 2000000000 : 33000000;
    if (frame == 1 || frame == MAP) monitor.setMap({surface, 1, Eigen::Isometry3d::Identity(), {}});
    if (frame == LIFTED) {  // the same map, up to what rests above it: that is no change of the map
      monitor.setMap({surface, 1, Eigen::Isometry3d(Eigen::Translation3d(0, 0, -0.06)), {}});
    }
    if (frame == NO_MAP) monitor.setMap({});
    for (const std::size_t b : {1, 0}) {
      MeshFrame mesh;
      mesh.stamp_ns = stamp_ns;
      mesh.topology = topology;
      mesh.positions = b == 0 ? cloth(frame) : resting();
      monitor.push(b, std::move(mesh), 0);
    }
    Outcome outcome;
    EXPECT_TRUE(monitor.next(0, outcome));
    if (log && !log->range().holds(outcome.sequence)) continue;
    told.answers.push_back(describe(outcome));
    told.patches.push_back(describePatches(outcome));
    log ? log->observe(outcome) : score.observe(outcome);
    if (!outcome.answered) continue;
    const Outcome prediction = monitor.predict();
    log ? log->predict(prediction) : score.predict(prediction);
  }
  if (!log) told.score = score.summary();
  return told;
}

class RangeLogTest : public ::testing::Test {
 protected:
  RangeLogTest() : folder_(std::filesystem::temp_directory_path() / ("range_log_" + std::to_string(getpid()))) {
    std::filesystem::create_directories(folder_);
  }
  ~RangeLogTest() override { std::filesystem::remove_all(folder_); }
  std::string file(std::size_t i) const { return folder_ / std::to_string(i); }

  /// Of ranges that end with these frames, and of the rest.
  Told joined(std::vector<std::uint64_t> ends, double gap_s) {
    ends.push_back(StepRange().last);
    Told all;
    RangeJoin join(gap_s, HORIZON_S);
    std::uint64_t first = 1;
    for (std::size_t i = 0; i < ends.size(); ++i) {
      {
        RangeLog log(file(i), {first, ends[i]}, HORIZON_S);
        const Told part = stream(&log, gap_s);
        all.answers.insert(all.answers.end(), part.answers.begin(), part.answers.end());
        log.close();
      }
      join.add(file(i), [&](const Outcome& outcome) { all.patches.push_back(describePatches(outcome)); });
      first = ends[i] + 1;
    }
    all.score = join.lookAhead();
    return all;
  }

  std::filesystem::path folder_;
};

TEST_F(RangeLogTest, AnyCutIsNoCut) {
  std::string all;
  for (const double gap_s : GAPS_S) {
    const Told whole = stream(nullptr, gap_s);
    ASSERT_EQ(whole.answers.size(), FRAMES);
    for (const std::string& patches : whole.patches) all += patches + '\n';
    ASSERT_GT(whole.score->compared, 20u);
    const auto expectSame = [&](const std::vector<std::uint64_t>& ends) {
      const Told cut = joined(ends, gap_s);
      SCOPED_TRACE("cut after frame " + std::to_string(ends.front()));
      EXPECT_EQ(cut.answers, whole.answers);
      EXPECT_EQ(cut.patches, whole.patches);
      EXPECT_EQ(cut.score->compared, whole.score->compared);
      EXPECT_EQ(cut.score->not_observed, whole.score->not_observed);
      EXPECT_EQ(cut.score->not_predicted, whole.score->not_predicted);
      EXPECT_EQ(cut.score->median_signed_error_s, whole.score->median_signed_error_s);
    };
    for (std::uint64_t end = 1; gap_s > 0 && end < FRAMES; end += 1 + (end % 3 == 0)) expectSame({end});
    expectSame({2, 3, NO_MAP - 1, GAP - 1, GAP, MAP - 1, MAP, LIFTED - 1, FRAMES - 1});
  }
  for (const char* event : {"BEGAN", "ENDED", "MERGED", "SPLIT", "INITIAL", "MAP_CHANGED"}) {
    EXPECT_NE(all.find(event), std::string::npos) << event << " does not happen here";
  }
}

TEST_F(RangeLogTest, OverAGapNothingIsCarried) {
  for (const auto& [first, last] : {std::pair<std::uint64_t, std::uint64_t>{1, 10}, {15, StepRange().last}}) {
    RangeLog log(file(first), {first, last}, 0);
    stream(&log, GAPS_S[1]);
    log.close();
  }
  RangeJoin join(GAPS_S[1], 0);
  std::string before, after;
  join.add(file(1), [&](const Outcome& o) { before += describePatches(o); });
  join.gap();
  join.add(file(15), [&](const Outcome& o) { after += describePatches(o) + '\n'; });
  ASSERT_NE(before.find("BEGAN"), std::string::npos);
  // What lived ends, nobody knows when, and what touches now is of another identity.
  const std::string first = after.substr(0, after.find('\n'));
  EXPECT_NE(first.find("ENDED"), std::string::npos) << first;
  EXPECT_NE(first.find("BEGAN"), std::string::npos) << first;
}

TEST_F(RangeLogTest, FilesThatAreNone) {
  RangeJoin join(0.25, 0);
  const auto nothing = [](const Outcome&) {};
  const auto expectRefused = [&](const std::string& said) {
    try {
      join.add(file(1), nothing);
      FAIL() << said;
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find(said), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find(file(1)), std::string::npos) << error.what();
    }
  };
  expectRefused("cannot be opened");
  std::filesystem::create_directory(file(1));
  expectRefused("is no regular file");
  std::filesystem::remove(file(1));
  std::ofstream(file(1)) << "not this one";
  expectRefused("was written by another version");
  {
    RangeLog log(file(1), {1, 10}, HORIZON_S);
    stream(&log, GAPS_S[1]);
    log.close();
  }
  const auto size = std::filesystem::file_size(file(1));
  ASSERT_GT(size, 1000u);
  std::filesystem::resize_file(file(1), size - 3);
  expectRefused("ends in the middle of a record");
  std::filesystem::resize_file(file(1), 8);
  std::ofstream(file(1), std::ios::app) << "?";
  expectRefused("unknown kind");
  EXPECT_THROW(RangeLog((folder_ / "none/here").string(), {}, 0), std::runtime_error);
}

}  // namespace
}  // namespace test
}  // namespace dccd
