#include "paper/paper_filters.h"

#include "paper/linear_reference.h"
#include "paper/non_penetration.h"
#include "paper/planar_reference.h"
#include "paper/primitive_bv.h"
#include "paper/simd/paper_filters.h"

namespace dccd {

const char* toString(PaperFilter filter) {
  switch (filter) {
    case PaperFilter::PRIMITIVE_BV:
      return "primitive_bv";
    case PaperFilter::LINEAR:
      return "linear";
    case PaperFilter::NON_PENETRATION:
      return "non_penetration";
    case PaperFilter::NON_PENETRATION_BATCHED:
      return "non_penetration_batched";
    case PaperFilter::PLANAR_PAPER:
      return "planar_paper";
    case PaperFilter::PLANAR_BRANCH_FREE:
      return "planar_branch_free";
    case PaperFilter::COUNT:
      break;
  }
  return "unknown";
}

namespace {

std::size_t nonPenetrationScalar(PairKind kind, const VertexMotion* vertices, const Quad* pairs, std::size_t count,
                                 Quad* survivors) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Quad pair = pairs[i];
    survivors[kept] = pair;
    kept += nonPenetrationSeparated(kind, vertices, pair) ? 0 : 1;
  }
  return kept;
}

}  // namespace

std::size_t filterPairs(PaperFilter filter, PairKind kind, const PaperRecords& records, const VertexMotion* vertices,
                        const Quad* pairs, std::size_t count, Quad* survivors) {
  if (count == 0) return 0;
  const bool vf = kind == PairKind::VERTEX_FACE;
  const float* r = records.data()->t0;
  const float error = records.error();
  const std::uint32_t* in = pairs->data();
  std::uint32_t* out = survivors->data();
  switch (filter) {
    case PaperFilter::PRIMITIVE_BV:
      return vf ? simd::paperPrimitiveBvVf(r, in, count, out) : simd::paperPrimitiveBvEe(r, in, count, out);
    case PaperFilter::LINEAR:
      return vf ? simd::paperLinearVf(r, in, count, out) : simd::paperLinearEe(r, in, count, out);
    case PaperFilter::NON_PENETRATION:
      return nonPenetrationScalar(kind, vertices, pairs, count, survivors);
    case PaperFilter::NON_PENETRATION_BATCHED:
      return vf ? simd::nonPenetrationVf(r, error, in, count, out) : simd::nonPenetrationEe(r, error, in, count, out);
    case PaperFilter::PLANAR_PAPER:
      return vf ? simd::paperPlanarVf(r, error, in, count, out) : simd::paperPlanarEe(r, error, in, count, out);
    case PaperFilter::PLANAR_BRANCH_FREE:
      return vf ? simd::branchFreePlanarVf(r, error, in, count, out)
                : simd::branchFreePlanarEe(r, error, in, count, out);
    case PaperFilter::COUNT:
      break;
  }
  return 0;
}

bool filterRejects(PaperFilter filter, PairKind kind, const PaperRecords& records, const VertexMotion* vertices,
                   const Quad& pair) {
  switch (filter) {
    case PaperFilter::PRIMITIVE_BV:
      return primitiveBvSeparated(kind, records.data(), pair);
    case PaperFilter::LINEAR:
      return linearSeparated(kind, records.data(), pair);
    case PaperFilter::NON_PENETRATION:
      return nonPenetrationSeparated(kind, vertices, pair);
    case PaperFilter::NON_PENETRATION_BATCHED:
      return nonPenetrationSeparated(kind, records.data(), pair, records.error());
    case PaperFilter::PLANAR_PAPER:
      return planarSeparated(PlanarForm::PAPER, kind, records.data(), pair, records.error());
    case PaperFilter::PLANAR_BRANCH_FREE:
      return planarSeparated(PlanarForm::BRANCH_FREE, kind, records.data(), pair, records.error());
    case PaperFilter::COUNT:
      break;
  }
  return false;
}

}  // namespace dccd
