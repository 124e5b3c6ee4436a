// hard_cases_benchmark: what hard pairs cost, which tier of `exact` answers, and what the usual methods make of them.
// Families of ordinary structured input against the same with its last bits perturbed (--cliffs), and of pairs made to
// be hard (--hard). Truth is the oracle's, for as many pairs of a family as --judge says; no time is printed for a
// family in which `exact` gave a wrong answer.
#include <fcl/narrowphase/detail/traversal/collision/intersect.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "dccd/elementary.h"
#include "oracle/oracle.h"
#include "oracle/promises.h"
#include "paper/fast_rival.h"
#include "support/generators.h"
#include "support/structured_pairs.h"
#include "support/timing.h"

namespace dccd {
namespace {

using test::batchOf, test::StructuredPairs;
using Answer = std::function<void(const PairBatch&, ElementaryResult*)>;

void runFcl(const PairBatch& b, ElementaryResult* out) {
  using Intersect = fcl::detail::Intersect<double>;
  for (std::size_t i = 0; i < b.count; ++i) {
    double toc = 0;
    fcl::Vector3d point;
    const auto x = [&](int p, int t) {
      const VertexMotion& v = b.vertices[b.pairs[i][p]];
      const double* at = t ? v.t1 : v.t0;
      return fcl::Vector3d(at[0], at[1], at[2]);
    };
    const bool hit = b.kind == PairKind::VERTEX_FACE
                         ? Intersect::intersect_VF_filtered(x(1, 0), x(2, 0), x(3, 0), x(0, 0), x(1, 1), x(2, 1),
                                                            x(3, 1), x(0, 1), &toc, &point)
                         : Intersect::intersect_EE_filtered(x(0, 0), x(1, 0), x(2, 0), x(3, 0), x(0, 1), x(1, 1),
                                                            x(2, 1), x(3, 1), &toc, &point);
    out[i].verdict = hit ? Verdict::CONTACT : Verdict::NO_CONTACT;
  }
}

Answer answerOf(std::shared_ptr<const Rung> test) {
  return [test](const PairBatch& b, ElementaryResult* out) {
    TierCounters counters;
    test->run(b, out, counters);
  };
}

/// Nanoseconds a pair, the median of the repeats.
double nanoseconds(const StructuredPairs& set, const Answer& answer, int repeats) {
  std::vector<ElementaryResult> out(set.pairs.size());
  std::vector<double> ns;
  for (int r = 0; r < repeats; ++r) {
    const benchmarks::Stopwatch watch;
    answer(batchOf(set), out.data());
    ns.push_back(1e9 * watch.seconds() / static_cast<double>(set.pairs.size()));
  }
  std::nth_element(ns.begin(), ns.begin() + ns.size() / 2, ns.end());
  return ns[ns.size() / 2];
}

/// The pair that costs most, each timed by itself, the least of the repeats.
double worstNanoseconds(const StructuredPairs& set, const Answer& answer, int repeats) {
  double worst = 0;
  ElementaryResult result;
  for (std::size_t i = 0; i < set.pairs.size(); ++i) {
    PairBatch batch = batchOf(set);
    batch.pairs += i;
    batch.count = 1;
    double least = HUGE_VAL;
    for (int r = 0; r < repeats; ++r) {
      const benchmarks::Stopwatch watch;
      answer(batch, &result);
      least = std::min(least, 1e9 * watch.seconds());
    }
    worst = std::max(worst, least);
  }
  return worst;
}

std::size_t wrongVerdicts(const std::vector<bool>& truth, const StructuredPairs& set, const Answer& answer,
                          std::size_t stride) {
  std::vector<ElementaryResult> out(set.pairs.size());
  answer(batchOf(set), out.data());
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) wrong += (out[i * stride].verdict == Verdict::CONTACT) != truth[i];
  return wrong;
}

nlohmann::json measured(const StructuredPairs& set, std::size_t judged, int repeats) {
  const Answer exact = answerOf(makeRung(AccuracyOptions())), fast = answerOf(makeFastRival());
  std::vector<ElementaryResult> answers(set.pairs.size());
  exact(batchOf(set), answers.data());
  const std::size_t stride = std::max<std::size_t>(1, set.pairs.size() / judged);
  std::vector<bool> truth;
  std::size_t contacts = 0;
  for (std::size_t i = 0; i < set.pairs.size(); i += stride) {
    std::optional<test::Root> toc = test::firstContact(set.kind, test::motionOf(set, i));
    truth.push_back(toc.has_value());
    contacts += toc.has_value();
    Query query;
    query.kind = set.kind;
    query.motion = test::motionOf(set, i);
    const std::string broken = test::brokenPromise(AccuracyOptions(), query, toc, answers[i]);
    if (!broken.empty()) throw std::runtime_error(set.family + ": exact is wrong: " + broken);
  }
  nlohmann::json tiers = nlohmann::json::object();
  for (const ElementaryResult& result : answers) {
    tiers[toString(result.tier)] = tiers.value(toString(result.tier), 0) + 1;
  }
  return {{"family", set.family},
          {"kind", toString(set.kind)},
          {"pairs", set.pairs.size()},
          {"judged", truth.size()},
          {"contacts", contacts},
          {"tiers", tiers},
          {"exact_ns", nanoseconds(set, exact, repeats)},
          {"exact_worst_ns", worstNanoseconds(set, exact, repeats)},
          {"fast_ns", nanoseconds(set, fast, repeats)},
          {"fast_wrong", wrongVerdicts(truth, set, fast, stride)},
          {"fcl_wrong", wrongVerdicts(truth, set, runFcl, stride)}};
}

/// A contact of the family, for its picture: the first one that is not at t = 0, else any pair.
nlohmann::json exampleOf(const StructuredPairs& set) {
  std::vector<ElementaryResult> answers(set.pairs.size());
  answerOf(makeRung(AccuracyOptions()))(batchOf(set), answers.data());
  std::size_t at = 0;
  double toc = 0;
  for (std::size_t i = 0; i < answers.size(); ++i) {
    if (answers[i].verdict != Verdict::CONTACT || (toc == 0 && i > 0 && answers[i].toc_lower == 0)) continue;
    at = i;
    toc = answers[i].toc_lower;
    if (toc > 0) break;
  }
  const PairMotion motion = test::motionOf(set, at);
  return {{"x", motion.x}, {"toc", toc}};
}

int run(int argc, char** argv) {
  CLI::App app{"What hard pairs cost, which tier answers, and what the usual methods make of them"};
  int cells = 30, repeats = 9;
  std::size_t judge = 100, count = 1000;
  std::string out;
  bool cliffs = false, hard = false;
  app.add_flag("--cliffs", cliffs, "structured input against the same perturbed");
  app.add_flag("--hard", hard, "pairs that are made to be hard");
  app.add_option("--cells", cells, "quads along a sheet's side")->check(CLI::Range(2, 200))->capture_default_str();
  app.add_option("--count", count, "hard pairs of each family and kind")->capture_default_str();
  app.add_option("--judge", judge, "pairs of each family that the oracle judges")->capture_default_str();
  app.add_option("--repeat", repeats, "repeats of each batch")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--out", out, "JSON file")->required();
  CLI11_PARSE(app, argc, argv);
  nlohmann::json result = {{"machine", benchmarks::machine()}};
  if (cliffs) {
    for (const StructuredPairs& set : test::structuredPairs(cells)) {
      nlohmann::json row = measured(set, judge, repeats);
      row["perturbed"] = measured(test::perturbed(set, 20170601), judge, repeats);
      result["cliffs"].push_back(row);
    }
  }
  if (hard) {
    for (int h = 0; h < static_cast<int>(test::Hardness::COUNT); ++h) {
      for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
        const StructuredPairs set = test::hardPairs(static_cast<test::Hardness>(h), kind, count);
        nlohmann::json row = measured(set, judge, repeats);
        row["example"] = exampleOf(set);
        result["hard"].push_back(row);
      }
    }
  }
  std::ofstream(out) << result.dump(1) << "\n";
  return 0;
}

}  // namespace
}  // namespace dccd

int main(int argc, char** argv) {
  try {
    return dccd::run(argc, argv);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "hard_cases_benchmark: %s\n", e.what());
    return 1;
  }
}
