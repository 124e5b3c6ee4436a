#include "dccd/elementary.h"

#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>

#include "elementary/rungs.h"

namespace dccd {
namespace {

[[noreturn]] void refuse(const std::string& what) { throw std::invalid_argument("accuracy options: " + what); }

void validate(const AccuracyOptions& options) {
  if (!(std::isfinite(options.tolerance_m) && options.tolerance_m > 0)) {
    refuse("tolerance_m must be finite and greater than 0, it is " + std::to_string(options.tolerance_m));
  }
  if (options.toc_bits < 10 || options.toc_bits > 52) {
    refuse("toc_bits must be between 10 and 52, it is " + std::to_string(options.toc_bits));
  }
  if (options.max_subdivisions < 1) {
    refuse("max_subdivisions must be at least 1, it is " + std::to_string(options.max_subdivisions));
  }
}

}  // namespace

std::unique_ptr<Rung> makeRung(const AccuracyOptions& options) {
  validate(options);
  switch (options.rung) {
    case Accuracy::FAST:
      return makeFastRung(options);
    case Accuracy::CONSERVATIVE:
      return makeConservativeRung(options);
    case Accuracy::EXACT:
      return makeExactRung(options);
    case Accuracy::SCREEN:
      refuse("rung screen has no elementary test, its answer is the filters'");
  }
  refuse("rung " + std::to_string(static_cast<int>(options.rung)) + " does not exist");
}

ElementaryResult testPair(const Rung& test, PairKind kind, const PairMotion& pair) {
  VertexMotion vertices[4] = {};
  for (int i = 0; i < 4; ++i) {
    std::memcpy(vertices[i].t0, pair.x[0][i], sizeof pair.x[0][i]);
    std::memcpy(vertices[i].t1, pair.x[1][i], sizeof pair.x[1][i]);
  }
  const Quad quad = {0, 1, 2, 3};
  PairBatch batch;
  batch.kind = kind;
  batch.vertices = vertices;
  batch.pairs = &quad;
  batch.count = 1;
  ElementaryResult result;
  TierCounters counters;
  test.run(batch, &result, counters);
  return result;
}

const char* toString(PairKind kind) {
  switch (kind) {
    case PairKind::VERTEX_FACE:
      return "vertex-face";
    case PairKind::EDGE_EDGE:
      return "edge-edge";
    case PairKind::VERTEX_VOXEL_FACE:
      return "vertex-voxel-face";
    case PairKind::EDGE_VOXEL_EDGE:
      return "edge-voxel-edge";
    case PairKind::FACE_VOXEL_CORNER:
      return "face-voxel-corner";
  }
  return "unknown";
}

const char* toString(Accuracy rung) {
  switch (rung) {
    case Accuracy::SCREEN:
      return "screen";
    case Accuracy::FAST:
      return "fast";
    case Accuracy::CONSERVATIVE:
      return "conservative";
    case Accuracy::EXACT:
      return "exact";
  }
  return "unknown";
}

const char* toString(Tier tier) {
  switch (tier) {
    case Tier::COINCIDENCE:
      return "coincidence";
    case Tier::DOUBLE_BATCH:
      return "double_batch";
    case Tier::BERNSTEIN:
      return "bernstein";
    case Tier::DOUBLE_DOUBLE:
      return "double_double";
    case Tier::FIXED_INTEGER:
      return "fixed_integer";
    case Tier::BIG_INTEGER:
      return "big_integer";
    case Tier::COUNT:
      break;
  }
  return "unknown";
}

Accuracy accuracyFromString(const char* text) {
  for (const Accuracy rung : {Accuracy::SCREEN, Accuracy::FAST, Accuracy::CONSERVATIVE, Accuracy::EXACT}) {
    if (std::strcmp(text, toString(rung)) == 0) return rung;
  }
  throw std::invalid_argument("accuracy: \"" + std::string(text) + "\" is none of screen, fast, conservative, exact");
}

}  // namespace dccd
