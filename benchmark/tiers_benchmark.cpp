// tiers_benchmark: what each tier of `exact` is worth. One is left out at a time: the linker puts a wrapper around it
// (--wrap in CMakeLists.txt), so that the library knows nothing of this. Answers must stay the same, else nothing is
// printed. Processor times with and without a tier are taken in
// turns.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstring>
#include <ctime>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "dccd/detect.h"
#include "elementary/exact_double_double.h"
#include "elementary/exact_tiers.h"
#include "oracle/query_file.h"
#include "simd/exact_batch.h"
#include "support/data.h"
#include "support/generators.h"
#include "support/scene_data.h"
#include "support/structured_pairs.h"
#include "support/timing.h"

namespace dccd {
namespace {

enum LeftOut { NOTHING, COINCIDENCE, BATCH, IN_PLANE, AXIS_MOTION, SIMPLE_TIMES, DOUBLE_DOUBLE, FIXED_INTEGERS, COUNT };
constexpr const char* NAMES[] = {
    "", "coincidence", "batch", "in a plane", "axis motion", "simple times", "double-double", "fixed integers"};
LeftOut left_out = NOTHING;
bool was_asked[COUNT] = {};

/// Is this tier left out? Counts that it was asked, which a wrapper that the linker does not know never is.
bool isOut(LeftOut tier) {
  was_asked[tier] = true;
  return left_out == tier;
}

}  // namespace
}  // namespace dccd

// The function itself, and what everybody calls in its place.
#define DCCD_WRAPPED(Result, name, symbol, arguments)    \
  Result real##name arguments __asm__("__real_" symbol); \
  Result wrapped##name arguments __asm__("__wrap_" symbol);
#define DCCD_TIER(name, symbol)                                                    \
  DCCD_WRAPPED(ElementaryResult, name, symbol "ENS_8PairKindERKNS_10PairMotionEi", \
               (PairKind kind, const PairMotion& pair, int toc_bits))
#define DCCD_LEFT_OUT(name, tier, instead)                                              \
  ElementaryResult wrapped##name(PairKind kind, const PairMotion& pair, int toc_bits) { \
    return isOut(tier) ? instead : real##name(kind, pair, toc_bits);                    \
  }

namespace dccd {

DCCD_TIER(Coincidence, "_ZN4dccd5exact19decideByCoincidence")
DCCD_TIER(InPlane, "_ZN4dccd5exact13decideInPlane")
DCCD_TIER(SimpleTime, "_ZN4dccd5exact18decideAtSimpleTime")
DCCD_TIER(AlongAxis, "_ZN4dccd5exact15decideAlongAxis")
DCCD_TIER(DoubleDouble, "_ZN4dccd5exact20decideByDoubleDouble")
DCCD_TIER(FixedIntegers, "_ZN4dccd5exact21decideByFixedIntegers")
DCCD_WRAPPED(ElementaryResult, Bracket, "_ZN4dccd5exact19contactAtSimpleTimeENS_8PairKindERKNS_10PairMotionEddi",
             (PairKind kind, const PairMotion& pair, double low, double high, int toc_bits))
DCCD_WRAPPED(std::int64_t, Cell, "_ZN4dccd5exact10cellOfRootERKNS0_16CoplanarityCubicEddi",
             (const exact::CoplanarityCubic& f, double low, double high, int toc_bits))
DCCD_WRAPPED(void, Batch, "_ZN4dccd4simd10exactBatchERKNS0_10BatchInputERKNS0_11BatchOutputE",
             (const simd::BatchInput& input, const simd::BatchOutput& output))

DCCD_LEFT_OUT(Coincidence, COINCIDENCE, exact::undecided(Tier::COINCIDENCE))
DCCD_LEFT_OUT(InPlane, IN_PLANE, exact::undecided(Tier::DOUBLE_DOUBLE))
DCCD_LEFT_OUT(SimpleTime, SIMPLE_TIMES, exact::undecided(Tier::FIXED_INTEGER))
DCCD_LEFT_OUT(AlongAxis, AXIS_MOTION, exact::undecided(Tier::FIXED_INTEGER))
DCCD_LEFT_OUT(DoubleDouble, DOUBLE_DOUBLE, exact::undecided(Tier::DOUBLE_DOUBLE))
DCCD_LEFT_OUT(FixedIntegers, FIXED_INTEGERS, exact::undecided(Tier::FIXED_INTEGER))

ElementaryResult wrappedBracket(PairKind kind, const PairMotion& pair, double low, double high, int toc_bits) {
  return isOut(SIMPLE_TIMES) ? exact::undecided(Tier::FIXED_INTEGER) : realBracket(kind, pair, low, high, toc_bits);
}
std::int64_t wrappedCell(const exact::CoplanarityCubic& f, double low, double high, int toc_bits) {
  return isOut(DOUBLE_DOUBLE) ? -1 : realCell(f, low, high, toc_bits);
}
void wrappedBatch(const simd::BatchInput& input, const simd::BatchOutput& output) {
  if (isOut(BATCH)) {
    std::fill_n(output.verdict, input.count, simd::BATCH_UNDECIDED);
  } else {
    realBatch(input, output);
  }
}

namespace {

using test::StructuredPairs;

/// What is measured, and what it came to, as text for comparison.
struct Question {
  std::function<void()> run;
  std::function<std::string()> answer;
};

std::string bytesOf(double a, double b, int verdict) {
  std::string bytes(2 * sizeof a + 1, static_cast<char>(verdict));
  std::memcpy(&bytes[0], &a, sizeof a);
  std::memcpy(&bytes[sizeof a], &b, sizeof b);
  return bytes;
}

/// Of this process: what else runs on the machine does not count.
double processorSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

/// The mean of as many runs as make a millisecond.
double secondsOf(const Question& question) {
  const double begin = processorSeconds();
  for (int runs = 1;; ++runs) {
    question.run();
    const double taken = processorSeconds() - begin;
    if (taken > 1e-3) return taken / runs;
  }
}

/// The least of the repeats, in turns; what takes longer than half a second is taken twice.
nlohmann::json measured(const std::string& group, const std::string& name, const Question& question, int repeats) {
  std::vector<double> seconds[COUNT];
  std::string answer;
  for (int r = 0; r < repeats; ++r) {
    for (int tier = 0; tier < COUNT; ++tier) {
      if (r >= 2 && seconds[tier][0] > 0.5) continue;
      left_out = static_cast<LeftOut>(tier);
      seconds[tier].push_back(secondsOf(question));
      left_out = NOTHING;
      const std::string now = question.answer();
      if (answer.empty()) answer = now;
      if (now != answer) throw std::runtime_error(name + ": without " + NAMES[tier] + " another answer");
    }
  }
  nlohmann::json row = {{"group", group}, {"name", name}};
  for (int tier = 0; tier < COUNT; ++tier) {
    row["seconds"][NAMES[tier]] = *std::min_element(seconds[tier].begin(), seconds[tier].end());
  }
  std::cerr << row.dump() << '\n';
  return row;
}

Question pairsOf(const StructuredPairs& set) {
  const auto results = std::make_shared<std::vector<ElementaryResult>>(set.pairs.size());
  const std::shared_ptr<const Rung> exact = makeRung(AccuracyOptions());
  const auto run = [&set, results, exact] {
    TierCounters counters;
    exact->run(test::batchOf(set), results->data(), counters);
  };
  return {run, [results] {
            std::string answer;
            for (const ElementaryResult& r : *results) {
              answer += bytesOf(r.toc_lower, r.toc_upper, static_cast<int>(r.verdict));
            }
            return answer;
          }};
}

Question stepOf(const std::string& scene) {
  const test::SceneData data = test::readScene(scene);
  Positions t0, t1;
  for (const VertexMotion& v : data.vertices) {
    t0.emplace_back(v.t0[0], v.t0[1], v.t0[2]);
    t1.emplace_back(v.t1[0], v.t1[1], v.t1[2]);
  }
  Step step;
  step.bodies.resize(1);
  step.bodies[0].name = scene;
  step.bodies[0].topology = share(Topology::fromTriangles(t0.size(), data.faces));
  step.bodies[0].t0 = share(std::move(t0));
  step.bodies[0].t1 = share(std::move(t1));
  const auto history = std::make_shared<History>();
  const auto found = std::make_shared<Outcome>();
  const auto run = [step, history, found] {
    Options options;
    options.check_start_state = false;
    *found = detect(step, options, *history);
  };
  return {run, [found] {
            std::string answer;
            for (const Contact& c : found->contacts) {
              answer += bytesOf(c.toc_lower, c.toc_upper, static_cast<int>(c.certainty));
            }
            return answer;
          }};
}

int run(int argc, char** argv) {
  CLI::App app{"What each tier of `exact` is worth: times without it"};
  int cells = 30, repeats = 5;
  std::size_t count = 1000;
  std::string out;
  app.add_option("--cells", cells, "quads along a sheet's side")->check(CLI::Range(2, 200))->capture_default_str();
  app.add_option("--count", count, "hard pairs of each family and kind")->capture_default_str();
  app.add_option("--repeat", repeats, "repeats")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--out", out, "JSON file")->required();
  CLI11_PARSE(app, argc, argv);
  nlohmann::json rows;
  if (!test::dataDir().empty()) {
    for (const char* scene : {"cloth-ball", "n-body"}) rows.push_back(measured("steps", scene, stepOf(scene), repeats));
    for (const QueryFileEntry& file : findQueryFiles(test::dataDir() + "/ccd_queries")) {
      const StructuredPairs set = test::pairsOf(file.family, file.kind, readQueryFile(file.path, file.kind));
      rows.push_back(measured("queries", set.family + ", " + toString(set.kind), pairsOf(set), repeats));
    }
  }
  for (int h = 0; h < static_cast<int>(test::Hardness::COUNT); ++h) {
    for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
      const StructuredPairs set = test::hardPairs(static_cast<test::Hardness>(h), kind, count);
      rows.push_back(measured("families", set.family + ", " + toString(kind), pairsOf(set), repeats));
    }
  }
  for (const StructuredPairs& set : test::structuredPairs(cells)) {
    rows.push_back(measured("sheets", set.family + ", " + toString(set.kind), pairsOf(set), repeats));
  }
  for (int tier = 1; tier < COUNT; ++tier) {
    if (!was_asked[tier]) throw std::runtime_error(std::string(NAMES[tier]) + " was never asked: is it wrapped?");
  }
  std::ofstream(out) << nlohmann::json{{"machine", benchmarks::machine()}, {"rows", rows}}.dump(1) << "\n";
  return 0;
}

}  // namespace
}  // namespace dccd

int main(int argc, char** argv) {
  try {
    return dccd::run(argc, argv);
  } catch (const std::exception& e) {
    std::cerr << "tiers_benchmark: " << e.what() << '\n';
    return 1;
  }
}
