// The elementary test: do two moving features meet during the step, and when first? One interface for
// every rung of the accuracy ladder.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <memory>

#include "dccd/export.h"
#include "dccd/tolerances.h"
#include "dccd/types.h"

namespace dccd {

/// Kinds of feature pairs. The last three are mesh feature against occupied octomap space.
enum class PairKind : std::uint8_t {
  VERTEX_FACE = 0,        ///< indices: vertex, then the face's three
  EDGE_EDGE = 1,          ///< indices: ea0 ea1 eb0 eb1
  VERTEX_VOXEL_FACE = 2,  ///< indices: vertex
  EDGE_VOXEL_EDGE = 3,    ///< indices: the edge's two
  FACE_VOXEL_CORNER = 4   ///< indices: the face's three
};

/// What is known of a kind of pair. This table alone says it.
struct PairKindFacts {
  const char* name;                      ///< that of toString()
  const char* short_name;                ///< in tables for programs
  const char* words;                     ///< in sentences for people
  std::array<std::uint8_t, 2> vertices;  ///< of each side's feature; none of the map's

  constexpr bool isOnMap() const { return vertices[1] == 0; }
  /// 0 or 1: the side that has the vertex at this place of the indices.
  constexpr std::size_t sideOf(std::size_t place) const { return place < vertices[0] ? 0 : 1; }
};
/// By PairKind.
inline constexpr PairKindFacts PAIR_KINDS[] = {
    {"vertex-face", "VF", "vertex against face", {1, 3}},
    {"edge-edge", "EE", "edge against edge", {2, 2}},
    {"vertex-voxel-face", "vertex-voxel_face", "vertex against voxel face", {1, 0}},
    {"edge-voxel-edge", "edge-voxel_edge", "edge against voxel edge", {2, 0}},
    {"face-voxel-corner", "face-voxel_corner", "face against voxel corner", {3, 0}},
};
static_assert(std::size(PAIR_KINDS) == static_cast<std::size_t>(PairKind::FACE_VOXEL_CORNER) + 1, "a row for each");
constexpr const PairKindFacts& factsOf(PairKind kind) { return PAIR_KINDS[static_cast<std::size_t>(kind)]; }

/// Rungs of the accuracy ladder. Recordings hold the values; 0 and 1 were rungs that proved nothing.
enum class Accuracy : std::uint8_t { CONSERVATIVE = 2, EXACT = 3 };

struct AccuracyOptions {
  Accuracy rung = Accuracy::EXACT;
  double tolerance_m =
      tolerance::CONTACT_M;     ///< conservative: > 0; false positives only where the features come this close [m]
  int toc_bits = 32;            ///< exact: TOC cell is 2^-toc_bits of the step; 10 to 52
  int max_subdivisions = 4096;  ///< conservative: cap per pair, then undecided
};

/// Two features over one step, coordinates exact: x[time][point][axis], times t=0 and t=1.
/// Points: VF v f0 f1 f2; EE ea0 ea1 eb0 eb1.
struct PairMotion {
  double x[2][4][3];
};

enum class Verdict : std::uint8_t { NO_CONTACT = 0, CONTACT = 1, UNDECIDED = 2 };

/// Which tier settled the pair (doc/algorithm.md). Purely informative.
enum class Tier : std::uint8_t {
  COINCIDENCE = 0,
  DOUBLE_BATCH,
  BERNSTEIN,
  DOUBLE_DOUBLE,
  FIXED_INTEGER,
  BIG_INTEGER,
  COUNT
};

/// toc_lower <= TOC; all in units of the step, [0,1].
/// exact, CONTACT: TOC lies in [toc_lower, toc_upper), toc_lower = k 2^-bits and toc_upper = (k+1) 2^-bits;
/// a TOC of exactly 1 gives the cell [1, 1]. UNDECIDED: a contact, if any, is not before toc_lower; toc_upper = 1.
struct ElementaryResult {
  double toc_lower = 0;
  double toc_upper = 1;
  Verdict verdict = Verdict::UNDECIDED;
  Tier tier = Tier::DOUBLE_BATCH;
};

/// A vertex over one step as the step's kernels want it: one cache line; the fourth lanes are zero.
struct alignas(64) VertexMotion {
  double t0[4];
  double t1[4];
};

/// Indices into an array of VertexMotion: VF v f0 f1 f2; EE ea0 ea1 eb0 eb1.
using Quad = std::array<Index, 4>;

/// A chunk of pairs of one kind (VERTEX_FACE or EDGE_EDGE).
struct PairBatch {
  PairKind kind = PairKind::VERTEX_FACE;
  const VertexMotion* vertices = nullptr;
  const Quad* pairs = nullptr;
  std::size_t count = 0;
  const double* minimum_separation_m = nullptr;  ///< one per pair, or null for none (conservative only)
  /// Pairs whose test takes long, and has not ended by then, are UNDECIDED with what is known of them; null: never.
  const Deadline* deadline = nullptr;
};

/// Pairs settled per tier since the counters were cleared.
struct TierCounters {
  std::array<std::uint64_t, static_cast<std::size_t>(Tier::COUNT)> settled{};
  TierCounters& operator+=(const TierCounters& other) {
    for (std::size_t i = 0; i < settled.size(); ++i) settled[i] += other.settled[i];
    return *this;
  }
};

/// A rung. Stateless and safe to call from several threads; one virtual call per chunk, none per pair. run() rounds to
/// nearest with denormals whatever mode the caller's thread is in, and leaves that as it was.
/// All coordinates must be finite (the caller leaves out unchecked vertices).
class DCCD_EXPORT Rung {
 public:
  virtual ~Rung() = default;
  virtual void run(const PairBatch& batch, ElementaryResult* results, TierCounters& counters) const = 0;
};

/// The rung for the options. Throws std::invalid_argument naming the option and value when one is out of range.
DCCD_EXPORT std::unique_ptr<Rung> makeRung(const AccuracyOptions& options);

/// Convenience for single pairs (tests, tools): one PairMotion through the same code as run().
DCCD_EXPORT ElementaryResult testPair(const Rung& test, PairKind kind, const PairMotion& pair);

DCCD_EXPORT const char* toString(PairKind kind);
DCCD_EXPORT const char* toString(Accuracy rung);
DCCD_EXPORT const char* toString(Tier tier);
/// Parses "conservative", "exact". Throws std::invalid_argument naming the text.
DCCD_EXPORT Accuracy accuracyFromString(const char* text);

}  // namespace dccd
