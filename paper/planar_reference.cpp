#include "paper/planar_reference.h"

#include <algorithm>
#include <cmath>

namespace dccd {
namespace {

struct PlanePoint {
  float x0, y0, x1, y1;
  float largest() const { return std::max(std::max(std::abs(x0), std::abs(y0)), std::max(std::abs(x1), std::abs(y1))); }
};

PlanePoint relative(const PaperRecord& p, const PaperRecord& origin, std::size_t k) {
  const std::size_t r = PAPER_ROTATED[k];
  return {p.t0[k] - origin.t0[k], p.t0[r] - origin.t0[r], p.t1[k] - origin.t1[k], p.t1[r] - origin.t1[r]};
}

void cross(const PlanePoint& p, const PlanePoint& q, float* c) {
  c[0] = p.x0 * q.y0 - p.y0 * q.x0;
  c[1] = (p.x0 * q.y1 - p.y0 * q.x1) + (p.x1 * q.y0 - p.y1 * q.x0);
  c[2] = p.x1 * q.y1 - p.y1 * q.x1;
}

/// +1 or -1: all three coefficients strictly beyond the margin on that side; 0: no proof.
int strictSign(const float* c, float margin) {
  if (c[0] > margin && c[1] > margin && c[2] > margin) return 1;
  if (c[0] < -margin && c[1] < -margin && c[2] < -margin) return -1;
  return 0;
}

/// Algorithm 1: the triangle keeps its orientation; the first edge with the vertex outside at t=0 decides.
bool algorithm1(const PlanarCoefficients& q) {
  const int orientation = strictSign(q.total, q.margin);
  if (orientation == 0) return false;
  for (const float* edge : {q.ab, q.bc, q.ca}) {
    const bool cutting = orientation > 0 ? edge[0] < 0 : edge[0] > 0;
    if (cutting) return strictSign(edge, q.margin) == -orientation;
  }
  return false;
}

/// Algorithm 2: the first edge whose line has both ends of the other on one side at t=0 decides.
bool algorithm2(const PlanarCoefficients& q) {
  const bool first = (q.ab[0] > 0 && q.total[0] > 0) || (q.ab[0] < 0 && q.total[0] < 0);
  if (first) return strictSign(q.ab, q.margin) * strictSign(q.total, q.margin) == 1;
  return strictSign(q.bc, q.margin) * strictSign(q.ca, q.margin) == -1;
}

bool branchFree(PairKind kind, const PlanarCoefficients& q) {
  const int ab = strictSign(q.ab, q.margin);
  const int signs[4] = {strictSign(q.bc, q.margin), strictSign(q.ca, q.margin), strictSign(q.total, q.margin),
                        kind == PairKind::VERTEX_FACE ? ab : -ab};
  return *std::max_element(signs, signs + 4) == 1 && *std::min_element(signs, signs + 4) == -1;
}

}  // namespace

PlanarCoefficients planarCoefficients(PairKind kind, const PaperRecord* records, const Quad& pair, std::size_t plane,
                                      float error) {
  const bool vf = kind == PairKind::VERTEX_FACE;
  const PaperRecord& origin = records[pair[vf ? 0 : 3]];
  const PlanePoint a = relative(records[pair[vf ? 1 : 0]], origin, plane);
  const PlanePoint b = relative(records[pair[vf ? 2 : 1]], origin, plane);
  const PlanePoint c = relative(records[pair[vf ? 3 : 2]], origin, plane);
  PlanarCoefficients q;
  cross(b, c, q.bc);
  cross(c, a, q.ca);
  cross(a, b, q.ab);
  for (int i = 0; i < 3; ++i) q.total[i] = (q.bc[i] + q.ca[i]) + q.ab[i];
  const float m = std::max(a.largest(), std::max(b.largest(), c.largest()));
  const float e = 2 * error + m * 0x1p-22f;
  q.margin = (32.0f * e) * (m + e);
  return q;
}

bool planarSeparated(PlanarForm form, PairKind kind, const PaperRecord* records, const Quad& pair, float error) {
  for (std::size_t plane = 0; plane < PAPER_DIRECTIONS; ++plane) {
    const PlanarCoefficients q = planarCoefficients(kind, records, pair, plane, error);
    if (form == PlanarForm::BRANCH_FREE) {
      if (branchFree(kind, q)) return true;
    } else if (kind == PairKind::VERTEX_FACE ? algorithm1(q) : algorithm2(q)) {
      return true;
    }
  }
  return false;
}

}  // namespace dccd
