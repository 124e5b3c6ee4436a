// The combinations of filters that the paper compares, each run over the same candidates and timed stage by stage.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "paper/benchmark/normal_cones.h"
#include "paper/paper_filters.h"
#include "paper/triangle_candidates.h"
#include "support/steps.h"

namespace dccd {
namespace benchmarks {

/// A filter of the paper's form, or one of the step's own: the fused planar and non-penetration filter, normal cones.
struct Filter {
  enum class Own { NONE, FUSED, CONES };
  PaperFilter paper = PaperFilter::COUNT;
  Own own = Own::NONE;
  const char* name() const {
    return own == Own::FUSED ? "fused" : own == Own::CONES ? "normal_cones" : toString(paper);
  }
};

struct StageCount {
  std::uint64_t in = 0, out = 0;
  double seconds = 0;
};

/// What one pipeline did: its filters, then the elementary test on what they kept. The elementary test is run on every
/// n-th chunk of candidates alone; its time is scaled up by pairs.
struct PipelineCount {
  std::vector<StageCount> filters;
  std::uint64_t survivors = 0;
  std::uint64_t tested = 0, called_colliding = 0;
  double test_seconds = 0;
  double elementarySeconds() const;
  double seconds() const;
};

struct Pipeline {
  std::string name;
  std::vector<Filter> filters;
  bool fcl_filtered = false;  ///< FCL's elementary test with its own filter in front
};
const std::vector<Pipeline>& pipelines();

/// Collects candidates in blocks and runs every pipeline over each block, in an order that changes from block to block,
/// so that none always finds the caches warm.
class PipelineRunner : public PairSink {
 public:
  /// elementary_every: 1 tests every chunk of survivors, n every n-th; 0 none.
  PipelineRunner(const Step& step, const PaperRecords& records, const NormalCones& cones, std::size_t elementary_every);
  void take(PairKind kind, Quad* pairs, std::size_t count) override;
  /// To be called after the last chunk.
  void finish();
  std::uint64_t candidates() const { return candidates_; }
  const std::vector<PipelineCount>& counts() const { return counts_; }
  /// Some of the pairs that the linear filter kept, for the check against the exact test.
  const std::vector<Quad>& sample(PairKind kind) const { return sample_[static_cast<std::size_t>(kind)]; }

 private:
  void runBlock(PairKind kind);
  void runPipeline(std::size_t number, PairKind kind, const std::vector<Quad>& block);

  const Step& step_;
  const PaperRecords& records_;
  const NormalCones& cones_;
  std::size_t elementary_every_;
  std::vector<Quad> block_[2], sample_[2];
  std::vector<Quad> chunk_;
  std::vector<std::uint32_t> kept_;
  std::vector<PipelineCount> counts_;
  std::uint64_t candidates_ = 0;
  std::size_t blocks_done_ = 0;
};

/// Pairs that are known to meet and that some filter rejects, as text; empty when there is none. `checked` counts them.
std::string lostContacts(const Step& step, const PaperRecords& records, const NormalCones& cones,
                         const std::vector<Quad> (&contacts)[2], std::size_t& checked);

/// Those of the pairs that the exact test calls contacts.
std::vector<Quad> exactContacts(const Step& step, PairKind kind, const std::vector<Quad>& pairs);

}  // namespace benchmarks
}  // namespace dccd
