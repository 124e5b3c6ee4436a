// The batched kernels: the same bits on every target and for every way of cutting the pairs into batches, and of real
// scenes hardly a pair left. Their answers on hard pairs are PairDifferential's matter.
#include "simd/exact_batch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <iostream>
#include <vector>

#include "simd/targets.h"
#include "support/data.h"
#include "support/generators.h"
#include "support/pair_list.h"
#include "support/scene_data.h"
#include "support/simd_targets.h"

namespace dccd {
namespace test {
namespace {

struct Answers {
  std::vector<std::uint8_t> verdict;
  std::vector<std::uint64_t> cell;
  std::vector<double> lo, hi;
  explicit Answers(std::size_t count) : verdict(count, 99), cell(count), lo(count), hi(count) {}
};

using Kernel = void (*)(const simd::BatchInput&, const simd::BatchOutput&);

/// Runs a kernel on calls of `portion` pairs.
Answers answersOf(Kernel kernel, const PairList& batch, int toc_bits, std::size_t portion) {
  Answers answers(batch.pairs.size());
  for (std::size_t begin = 0; begin < batch.pairs.size(); begin += portion) {
    simd::BatchInput input;
    input.vertices = batch.vertices[0].t0;
    input.quads = reinterpret_cast<const std::uint32_t(*)[4]>(batch.pairs.data() + begin);
    input.count = std::min(portion, batch.pairs.size() - begin);
    input.kind = batch.kind == PairKind::VERTEX_FACE ? simd::BatchKind::VERTEX_FACE : simd::BatchKind::EDGE_EDGE;
    input.toc_bits = toc_bits;
    kernel(input, {&answers.verdict[begin], &answers.cell[begin], &answers.lo[begin], &answers.hi[begin]});
  }
  return answers;
}

/// Compares what the interface promises to set, bit for bit.
void expectSame(const Answers& expected, const Answers& actual, const std::string& what) {
  ASSERT_EQ(expected.verdict, actual.verdict) << what;
  for (std::size_t i = 0; i < expected.verdict.size(); ++i) {
    const std::uint8_t verdict = expected.verdict[i];
    if (verdict != simd::BATCH_YES && verdict != simd::BATCH_YES_BRACKET) continue;
    ASSERT_EQ(std::memcmp(&expected.lo[i], &actual.lo[i], sizeof(double)), 0) << what << ", pair " << i;
    ASSERT_EQ(std::memcmp(&expected.hi[i], &actual.hi[i], sizeof(double)), 0) << what << ", pair " << i;
    if (verdict == simd::BATCH_YES_BRACKET) continue;
    ASSERT_EQ(expected.cell[i], actual.cell[i]) << what << ", pair " << i;
  }
}

/// Pairs of every hardness and general ones in turn, so that every path of the kernels has neighbours of other paths.
PairList mixedBatch(PairKind kind, std::size_t count) {
  RandomSource random(20170601);
  PairList batch(kind);
  constexpr int KINDS = static_cast<int>(Hardness::COUNT);
  for (std::size_t i = 0; i < count; ++i) {
    const Hardness hardness = i % 2 == 0 ? Hardness::GENERAL : static_cast<Hardness>(i / 2 % KINDS);
    batch.add(hardQuery(random, kind, hardness).motion);
  }
  return batch;
}

constexpr PairKind KINDS[] = {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE};

TEST(ExactBatch, EveryTargetComputesTheSameBits) {
  int targets = 0;
  for (const PairKind kind : KINDS) {
    const PairList batch = mixedBatch(kind, 6000);
    for (const int bits : {10, 32, 52}) {
      const Answers exact = answersOf(simd::exactBatch, batch, bits, 2000);
      ASSERT_GT(std::count(exact.verdict.begin(), exact.verdict.end(), bits == 52 ? 3 : 1), 100);
      forEachTarget([&](const std::string& target) {
        ++targets;
        ASSERT_EQ(target, simd::activeTarget());
        expectSame(exact, answersOf(simd::exactBatch, batch, bits, 2000), target);
      });
    }
  }
  EXPECT_GE(targets, 6) << "no target but one runs here";
}

// Portions that are no multiple of a vector or of the kernel's blocks, down to single pairs; and nothing beyond the
// end of the outputs is written.
TEST(ExactBatch, AnswersDoNotDependOnThePortions) {
  for (const PairKind kind : KINDS) {
    const PairList batch = mixedBatch(kind, 700);
    const Answers whole = answersOf(simd::exactBatch, batch, 32, 700);
    forEachTarget([&](const std::string& target) {
      for (const std::size_t portion : {1, 2, 3, 5, 7, 8, 9, 63, 64, 65, 127, 129, 333}) {
        expectSame(whole, answersOf(simd::exactBatch, batch, 32, portion),
                   target + ", portions of " + std::to_string(portion));
      }
    });
    simd::BatchInput input;
    input.vertices = batch.vertices[0].t0;
    input.quads = reinterpret_cast<const std::uint32_t(*)[4]>(batch.pairs.data());
    input.count = 61;
    input.kind = kind == PairKind::VERTEX_FACE ? simd::BatchKind::VERTEX_FACE : simd::BatchKind::EDGE_EDGE;
    Answers guarded(128);
    std::fill(guarded.lo.begin(), guarded.lo.end(), -7.0);
    simd::exactBatch(input, {guarded.verdict.data(), guarded.cell.data(), guarded.lo.data(), guarded.hi.data()});
    for (std::size_t i = 61; i < 128; ++i) {
      ASSERT_EQ(guarded.verdict[i], 99);
      ASSERT_EQ(guarded.lo[i], -7.0);
    }
    input.count = 0;
    simd::exactBatch(input, {nullptr, nullptr, nullptr, nullptr});
  }
}

void checkScene(const std::string& name, std::size_t most_undecided) {
  const SceneData scene = readScene(name);
  std::size_t undecided = 0, without_cell = 0, pairs = 0;
  for (const PairKind kind : KINDS) {
    const std::vector<TruthPair>& truth = kind == PairKind::VERTEX_FACE ? scene.vertex_face : scene.edge_edge;
    PairList batch(kind);
    batch.vertices = scene.vertices;
    for (const TruthPair& pair : truth) batch.pairs.push_back(pair.pair);
    const Answers answers = answersOf(simd::exactBatch, batch, 32, 2000);
    for (std::size_t i = 0; i < truth.size(); ++i) {
      ++pairs;
      without_cell += answers.verdict[i] == simd::BATCH_YES_BRACKET;
      undecided += answers.verdict[i] == simd::BATCH_UNDECIDED;
      if (answers.verdict[i] == simd::BATCH_UNDECIDED) continue;
      ASSERT_EQ(answers.verdict[i] != simd::BATCH_NO, truth[i].contact) << name << ' ' << toString(kind) << ' ' << i;
    }
  }
  std::cout << name << ": " << pairs << " pairs, " << undecided << " undecided, " << without_cell
            << " contacts without a cell\n";
  EXPECT_LE(undecided, most_undecided);
  EXPECT_LE(without_cell, pairs / 500);
}

// On cloth-ball nothing is left; on n-body the 3,520 pairs of coincident vertices at rest, which a cheaper tier
// settles, and at most a few pairs of nearly parallel edges.
TEST(ExactBatch, NeverContradictsTheTruthOfClothBall) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  checkScene("cloth-ball", 5);
}

TEST(ExactBatch, NeverContradictsTheTruthOfNBody) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  checkScene("n-body", 3520 + 10);
}

}  // namespace
}  // namespace test
}  // namespace dccd
