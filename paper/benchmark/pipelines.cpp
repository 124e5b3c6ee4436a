#include "paper/benchmark/pipelines.h"

#include <algorithm>

#include "paper/benchmark/fcl_elementary.h"
#include "simd/fused_filter.h"
#include "support/timing.h"

namespace dccd {
namespace benchmarks {
namespace {

constexpr std::size_t BLOCK = std::size_t{1} << 18;  // pairs: 4 MiB, so that filters stream them from memory
constexpr std::size_t CHUNK = 2048;
constexpr std::size_t SAMPLE = 20000;

Filter paper(PaperFilter filter) { return {filter, Filter::Own::NONE}; }
constexpr Filter FUSED{PaperFilter::COUNT, Filter::Own::FUSED}, CONES{PaperFilter::COUNT, Filter::Own::CONES};

/// Pairs that a filter keeps; `places` has room for as many as come in.
std::size_t keep(const Filter& filter, const Step& step, const PaperRecords& records, const NormalCones& cones,
                 PairKind kind, const Quad* pairs, std::size_t count, std::vector<std::uint32_t>& places, Quad* out) {
  if (count == 0) return 0;
  if (filter.own == Filter::Own::CONES) return cones.keep(kind, pairs, count, out);
  if (filter.own == Filter::Own::NONE) {
    return filterPairs(filter.paper, kind, records, step.vertices.data(), pairs, count, out);
  }
  const std::size_t kept = simd::fusedFilter(step.vertices.data()->t0, pairs->data(), count,
                                             kind == PairKind::EDGE_EDGE, simd::FusedPlanes::ALL, places.data());
  for (std::size_t i = 0; i < kept; ++i) out[i] = pairs[places[i]];
  return kept;
}

}  // namespace

const std::vector<Pipeline>& pipelines() {
  static const std::vector<Pipeline> all{
      {"elementary", {}, false},
      {"fcl_filtered", {}, true},
      {"bv", {paper(PaperFilter::PRIMITIVE_BV)}, false},
      {"bv+nonpen", {paper(PaperFilter::PRIMITIVE_BV), paper(PaperFilter::NON_PENETRATION)}, false},
      {"bv+nonpen_batched", {paper(PaperFilter::PRIMITIVE_BV), paper(PaperFilter::NON_PENETRATION_BATCHED)}, false},
      {"linear", {paper(PaperFilter::LINEAR)}, false},
      {"linear+planar", {paper(PaperFilter::LINEAR), paper(PaperFilter::PLANAR_PAPER)}, false},
      {"linear+planar_branch_free", {paper(PaperFilter::LINEAR), paper(PaperFilter::PLANAR_BRANCH_FREE)}, false},
      {"linear+fused", {paper(PaperFilter::LINEAR), FUSED}, false},
      {"cones+linear+planar", {CONES, paper(PaperFilter::LINEAR), paper(PaperFilter::PLANAR_PAPER)}, false},
      {"cones+linear+fused", {CONES, paper(PaperFilter::LINEAR), FUSED}, false},
  };
  return all;
}

double PipelineCount::elementarySeconds() const {
  return tested == 0 ? 0 : test_seconds * static_cast<double>(survivors) / static_cast<double>(tested);
}

double PipelineCount::seconds() const {
  double sum = elementarySeconds();
  for (const StageCount& s : filters) sum += s.seconds;
  return sum;
}

PipelineRunner::PipelineRunner(const Step& step, const PaperRecords& records, const NormalCones& cones,
                               std::size_t elementary_every)
    : step_(step), records_(records), cones_(cones), elementary_every_(elementary_every), chunk_(CHUNK), kept_(CHUNK) {
  for (const Pipeline& p : pipelines()) {
    counts_.emplace_back();
    counts_.back().filters.resize(p.filters.size());
  }
  for (std::vector<Quad>& block : block_) block.reserve(BLOCK + TriangleCandidates::CHUNK);
}

void PipelineRunner::take(PairKind kind, Quad* pairs, std::size_t count) {
  std::vector<Quad>& block = block_[static_cast<std::size_t>(kind)];
  block.insert(block.end(), pairs, pairs + count);
  candidates_ += count;
  if (block.size() >= BLOCK) runBlock(kind);
}

void PipelineRunner::finish() {
  runBlock(PairKind::VERTEX_FACE);
  runBlock(PairKind::EDGE_EDGE);
}

void PipelineRunner::runBlock(PairKind kind) {
  std::vector<Quad>& block = block_[static_cast<std::size_t>(kind)];
  const std::size_t n = counts_.size();
  for (std::size_t i = 0; i < n; ++i) runPipeline((i + blocks_done_) % n, kind, block);
  ++blocks_done_;
  block.clear();
}

void PipelineRunner::runPipeline(std::size_t number, PairKind kind, const std::vector<Quad>& block) {
  const Pipeline& pipeline = pipelines()[number];
  PipelineCount& total = counts_[number];
  for (std::size_t begin = 0, chunk = 0; begin < block.size(); begin += CHUNK, ++chunk) {
    const Quad* pairs = block.data() + begin;
    std::size_t count = std::min(CHUNK, block.size() - begin);
    for (std::size_t f = 0; f < pipeline.filters.size(); ++f) {
      StageCount& stage = total.filters[f];
      stage.in += count;
      const Stopwatch watch;
      count = keep(pipeline.filters[f], step_, records_, cones_, kind, pairs, count, kept_, chunk_.data());
      stage.seconds += watch.seconds();
      stage.out += count;
      pairs = chunk_.data();
    }
    total.survivors += count;
    if (pipeline.name == "linear") {
      std::vector<Quad>& sample = sample_[static_cast<std::size_t>(kind)];
      for (std::size_t i = chunk % 7; i < count && sample.size() < SAMPLE; i += 7) sample.push_back(pairs[i]);
    }
    // Which chunks are tested does not depend on the pipeline, so that all are timed on the same candidates.
    if (elementary_every_ == 0 || (chunk + blocks_done_) % elementary_every_ != 0) continue;
    const Stopwatch watch;
    total.called_colliding += fclElementary(kind, step_.vertices.data(), pairs, count, pipeline.fcl_filtered);
    total.test_seconds += watch.seconds();
    total.tested += count;
  }
}

std::string lostContacts(const Step& step, const PaperRecords& records, const NormalCones& cones,
                         const std::vector<Quad> (&contacts)[2], std::size_t& checked) {
  std::vector<Filter> filters{FUSED, CONES};
  for (int f = 0; f < static_cast<int>(PaperFilter::COUNT); ++f) filters.push_back(paper(static_cast<PaperFilter>(f)));
  for (PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    const std::vector<Quad>& pairs = contacts[static_cast<std::size_t>(kind)];
    checked += pairs.size();
    std::vector<Quad> kept(pairs.size());
    std::vector<std::uint32_t> places(pairs.size());
    for (const Filter& filter : filters) {
      const std::size_t n = keep(filter, step, records, cones, kind, pairs.data(), pairs.size(), places, kept.data());
      if (n == pairs.size()) continue;
      return std::string(filter.name()) + " rejects " + std::to_string(pairs.size() - n) + " true contacts (" +
             toString(kind) + ")";
    }
  }
  return {};
}

std::vector<Quad> exactContacts(const Step& step, PairKind kind, const std::vector<Quad>& pairs) {
  const auto test = makeRung({});
  std::vector<ElementaryResult> results(pairs.size());
  TierCounters counters;
  PairBatch batch;
  batch.kind = kind;
  batch.vertices = step.vertices.data();
  batch.pairs = pairs.data();
  batch.count = pairs.size();
  test->run(batch, results.data(), counters);
  std::vector<Quad> contacts;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (results[i].verdict == Verdict::CONTACT) contacts.push_back(pairs[i]);
  }
  return contacts;
}

}  // namespace benchmarks
}  // namespace dccd
