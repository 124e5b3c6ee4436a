#include "dccd/elementary.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <stdexcept>
#include <string>

#include "base/accuracy.h"
#include "elementary/batch_input.h"

namespace dccd {

// Each in the file of its rung. Options are validated here, once for all of them.
std::unique_ptr<Rung> makeConservativeRung(const AccuracyOptions& options);
std::unique_ptr<Rung> makeExactRung(const AccuracyOptions& options);

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

/// A rung of the ladder; its place in the list, from the first one's value on, is its value as Accuracy.
struct RungRow {
  const char* name;
  std::unique_ptr<Rung> (*make)(const AccuracyOptions&);
  bool holds_distance;
};
constexpr RungRow RUNGS[] = {
    {"conservative", makeConservativeRung, true},
    {"exact", makeExactRung, false},
};
constexpr std::size_t FIRST = static_cast<std::size_t>(Accuracy::CONSERVATIVE);

const RungRow* rowOf(Accuracy rung) {
  const std::size_t value = static_cast<std::size_t>(rung);
  return value >= FIRST && value - FIRST < std::size(RUNGS) ? &RUNGS[value - FIRST] : nullptr;
}

}  // namespace

std::unique_ptr<Rung> makeRung(const AccuracyOptions& options) {
  validate(options);
  const RungRow* row = rowOf(options.rung);
  if (!row) refuse("rung " + std::to_string(static_cast<int>(options.rung)) + " does not exist");
  return row->make(options);
}

const std::vector<Accuracy>& allRungs() {
  static const std::vector<Accuracy> all = [] {
    std::vector<Accuracy> rungs;
    for (std::size_t i = 0; i < std::size(RUNGS); ++i) rungs.push_back(static_cast<Accuracy>(FIRST + i));
    return rungs;
  }();
  return all;
}

bool holdsDistance(Accuracy rung) {
  const RungRow* row = rowOf(rung);
  return row && row->holds_distance;
}

simd::BatchInput inputOf(const PairBatch& batch, Accuracy rung) {
  const auto refuse = [&](const std::string& what) {
    throw std::invalid_argument(std::string(toString(rung)) + " test: " + what);
  };
  if (batch.kind != PairKind::VERTEX_FACE && batch.kind != PairKind::EDGE_EDGE) {
    refuse(std::string("kind ") + toString(batch.kind) + " is not vertex-face or edge-edge");
  }
  if (batch.minimum_separation_m != nullptr && !holdsDistance(rung)) {
    refuse("a minimum separation needs the rung conservative");
  }
  simd::BatchInput input;
  input.vertices = reinterpret_cast<const double*>(batch.vertices);
  input.kind = batch.kind == PairKind::VERTEX_FACE ? simd::BatchKind::VERTEX_FACE : simd::BatchKind::EDGE_EDGE;
  return input;
}

void setBlock(const PairBatch& batch, std::size_t begin, simd::BatchInput& input) {
  static_assert(sizeof(VertexMotion) == 8 * sizeof(double) && sizeof(Quad) == 4 * sizeof(std::uint32_t));
  input.quads = reinterpret_cast<const std::uint32_t(*)[4]>(batch.pairs + begin);
  input.count = std::min(BLOCK, batch.count - begin);
}

ElementaryResult testPair(const Rung& test, PairKind kind, const PairMotion& pair) {
  VertexMotion vertices[4] = {};
  for (int i = 0; i < 4; ++i) {
    std::memcpy(vertices[i].t0, pair.x[0][i], sizeof pair.x[0][i]);
    std::memcpy(vertices[i].t1, pair.x[1][i], sizeof pair.x[1][i]);
  }
  const Quad quad = {0, 1, 2, 3};
  ElementaryResult result;
  TierCounters counters;
  test.run({kind, vertices, &quad, 1}, &result, counters);
  return result;
}

const char* toString(PairKind kind) {
  return static_cast<std::size_t>(kind) < std::size(PAIR_KINDS) ? factsOf(kind).name : "unknown";
}

const char* toString(Accuracy rung) {
  const RungRow* row = rowOf(rung);
  return row ? row->name : "unknown";
}

const char* toString(Tier tier) {
  static const char* const NAMES[] = {"coincidence",   "double_batch",  "bernstein",
                                      "double_double", "fixed_integer", "big_integer"};
  const std::size_t i = static_cast<std::size_t>(tier);
  return i < std::size(NAMES) ? NAMES[i] : "unknown";
}

Accuracy accuracyFromString(const char* text) {
  std::string known;
  for (const Accuracy rung : allRungs()) {
    if (std::strcmp(text, toString(rung)) == 0) return rung;
    known += (known.empty() ? "" : ", ") + std::string(toString(rung));
  }
  throw std::invalid_argument("accuracy: \"" + std::string(text) + "\" is none of " + known);
}

}  // namespace dccd
