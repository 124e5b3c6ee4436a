// Hard pairs by the million: every elementary test, on every SIMD target, in batches, against the oracle.
// DEFORMABLE_CCD_LONG=1 runs 1e7 of them, DEFORMABLE_CCD_BLOCKS="FIRST COUNT" a part of these, in blocks of 10,000; the
// seed is fixed, or DEFORMABLE_CCD_SEED. What fails is written to a file
// that run_queries replays; the single-pair tests beside this one shrink it.
#include <gtest/gtest.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <iostream>
#include <mutex>
#include <sstream>
#include <utility>
#include <vector>

#include "dccd/elementary.h"
#include "oracle/oracle.h"
#include "oracle/promises.h"
#include "step/fork_join.h"
#include "support/generators.h"
#include "support/query_property.h"
#include "support/step_support.h"

namespace dccd {
namespace test {
namespace {

constexpr std::size_t BLOCK = 10000, CHUNK = 250;

/// body(begin, end) for all of a block, on all cores.
template <class Body>
void inChunks(const Body& body) {
  ForkJoin::fork();
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, BLOCK, CHUNK),
      [&](const tbb::blocked_range<std::size_t>& range)
          DEFORMABLE_CCD_COPIED_BY_TBB { ForkJoin::piece(body, range.begin(), range.end()); },
      tbb::simple_partitioner());
  ForkJoin::join();
}

std::vector<AccuracyOptions> allRungs() {
  std::vector<AccuracyOptions> rungs;
  AccuracyOptions options;
  for (const int bits : {10, 32, 52}) {
    options.toc_bits = bits;
    rungs.push_back(options);
  }
  options = AccuracyOptions();
  options.rung = Accuracy::CONSERVATIVE;
  rungs.push_back(options);
  return rungs;
}

/// Pairs of one kind as the detector lays them out, with their truth.
struct Block {
  std::vector<Query> queries;
  std::vector<std::optional<Root>> truth;
  std::vector<VertexMotion> vertices;
  std::vector<Quad> quads;

  Block(std::uint64_t first_seed, PairKind kind) : queries(BLOCK), truth(BLOCK), vertices(4 * BLOCK), quads(BLOCK) {
    inChunks([&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i != end; ++i) {
        RandomSource random(first_seed + i);
        queries[i] = hardQuery(random, kind);
        truth[i] = firstContact(kind, queries[i].motion);
        for (std::size_t v = 0; v < 4; ++v) {
          quads[i][v] = static_cast<Index>(4 * i + v);
          std::copy_n(queries[i].motion.x[0][v], 3, vertices[4 * i + v].t0);
          std::copy_n(queries[i].motion.x[1][v], 3, vertices[4 * i + v].t1);
        }
      }
    });
  }

  PairBatch batch(std::size_t begin, std::size_t end) const {
    PairBatch result;
    result.kind = queries.front().kind;
    result.vertices = vertices.data();
    result.pairs = quads.data() + begin;
    result.count = end - begin;
    return result;
  }
};

/// The first block to run, and how many.
std::pair<std::size_t, std::size_t> blocksToRun() {
  std::size_t first = 0, count = longRun() ? 1000 : 2;
  if (const char* text = std::getenv("DEFORMABLE_CCD_BLOCKS")) std::istringstream(text) >> first >> count;
  return {first, count};
}

TEST(PairDifferential, EveryRungOnEveryTargetKeepsItsPromise) {
  const std::size_t first_block = blocksToRun().first, blocks = blocksToRun().second;
  const std::vector<AccuracyOptions> rungs = allRungs();
  std::atomic<std::size_t> tested{0}, contacts{0};
  std::mutex failure;
  std::string targets;
  for (std::size_t b = first_block; b < first_block + blocks && !HasFailure(); ++b) {
    const PairKind kind = b % 2 == 0 ? PairKind::VERTEX_FACE : PairKind::EDGE_EDGE;
    Block block(propertySeed() + b * BLOCK, kind);
    contacts += static_cast<std::size_t>(
        std::count_if(block.truth.begin(), block.truth.end(), [](const auto& toc) { return toc.has_value(); }));
    // The answers on the first target are judged by the oracle; those on the others must be the same.
    std::vector<std::vector<ElementaryResult>> answers(rungs.size());
    forEachSimdTarget([&](const std::string& target) {
      if (b == first_block) targets += " " + target;
      const bool first = answers[0].empty();
      if (first) std::fill(answers.begin(), answers.end(), std::vector<ElementaryResult>(BLOCK));
      inChunks([&](std::size_t begin, std::size_t end) {
        std::vector<ElementaryResult> results(end - begin);
        for (std::size_t r = 0; r < rungs.size(); ++r) {
          const AccuracyOptions& options = rungs[r];
          TierCounters counters;
          makeRung(options)->run(block.batch(begin, end), results.data(), counters);
          for (std::size_t i = begin; i != end; ++i) {
            const ElementaryResult& result = results[i - begin];
            std::string wrong;
            if (first) {
              answers[r][i] = result;
              wrong = brokenPromise(options, block.queries[i], block.truth[i], result);
            } else if (!sameAnswer(result, answers[r][i])) {
              wrong = "another answer than on the first target";
            }
            if (wrong.empty()) continue;
            const std::lock_guard<std::mutex> lock(failure);
            ADD_FAILURE() << toString(options.rung) << " " << options.toc_bits << " bits on " << target << ": " << wrong
                          << "\nreplay: run_queries " << writeReplayFile("pair-differential", block.queries[i]);
            return;
          }
        }
        tested += end - begin;
      });
    });
  }
  std::cout << blocks * BLOCK << " hard pairs, " << contacts << " in contact, each by " << rungs.size() << " rungs on"
            << targets << ": " << tested * rungs.size() << " answers judged\n";
  EXPECT_GT(contacts, blocks * BLOCK / 10);
}

}  // namespace
}  // namespace test
}  // namespace dccd
