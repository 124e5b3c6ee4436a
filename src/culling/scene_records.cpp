// A step's positions into the scene's arrays: vertices, the range of their records, and the bounds of what has moved.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>

#include "culling/scene_arrays.h"
#include "dccd/tolerances.h"

namespace dccd {
namespace {

// Where a body rests: how much wider the records' range is on either side than the scene, so that others may move, and
// how much of it the scene must fill, since the wider the range, the coarser the bounds (of 65,528 values a direction).
constexpr double PADDING = tolerance::RECORD_PADDING, SMALLEST_SHARE = tolerance::RECORD_SHARE;

constexpr std::size_t PIECE = 2048;  // vertices that are recorded in one go

// a - b as an unevaluated sum without error (Knuth's two-sum); not finite when it overflows.
struct ExactDifference {
  double high, low;
  friend bool operator==(const ExactDifference& x, const ExactDifference& y) {
    return x.high == y.high && x.low == y.low;
  }
};
ExactDifference exactDifference(double a, double b) {
  const double high = a - b, virtual_b = a - high, virtual_a = high + virtual_b;
  return {high, (a - virtual_a) + (virtual_b - b)};
}

void checkPositions(const SceneBody& body, const Body& motion) {
  const std::size_t n = body.setup.topology->vertexCount();
  if (motion.t0 && motion.t1 && motion.t0->size() == n && motion.t1->size() == n) return;
  throw std::invalid_argument("body '" + body.setup.name + "' needs " + std::to_string(n) +
                              " positions at t0 and t1, got " + std::to_string(motion.t0 ? motion.t0->size() : 0) +
                              " and " + std::to_string(motion.t1 ? motion.t1->size() : 0));
}

/// Of one vertex or more, if all are finite: two at a time, so that coordinates lie in three pairs.
bool spanFinite(const Positions& positions, Extent& extent) {
  using Pair = Eigen::Array2d;
  const auto pairAt = [](const double* at) -> Pair { return Eigen::Map<const Pair>(at); };
  const Vec3& last = positions.back();
  Pair lo_xy = last.head<2>(), lo_zx(last.z(), last.x()), lo_yz = last.tail<2>();
  Pair hi_xy = lo_xy, hi_zx = lo_zx, hi_yz = lo_yz, sum = lo_xy + lo_yz;
  const double* at = positions.front().data();
  for (std::size_t two = positions.size() / 2; two > 0; --two, at += 6) {
    const Pair xy = pairAt(at), zx = pairAt(at + 2), yz = pairAt(at + 4);
    lo_xy = lo_xy.min(xy), lo_zx = lo_zx.min(zx), lo_yz = lo_yz.min(yz);
    hi_xy = hi_xy.max(xy), hi_zx = hi_zx.max(zx), hi_yz = hi_yz.max(yz);
    sum += (xy + zx) + yz;
  }
  extent.lo = {std::min(lo_xy[0], lo_zx[1]), std::min(lo_xy[1], lo_yz[0]), std::min(lo_zx[0], lo_yz[1])};
  extent.hi = {std::max(hi_xy[0], hi_zx[1]), std::max(hi_xy[1], hi_yz[0]), std::max(hi_zx[0], hi_yz[1])};
  return sum.isFinite().all();  // false, too, where a sum overflows, which costs time alone
}

Extent extentOf(const std::shared_ptr<const Positions>& positions) {
  Extent finite{positions, Vec3::Zero(), Vec3::Zero(), true};
  if (!positions->empty() && spanFinite(*positions, finite)) return finite;
  constexpr double MOST = std::numeric_limits<double>::infinity();
  double lo[3] = {MOST, MOST, MOST}, hi[3] = {-MOST, -MOST, -MOST};
  for (const Vec3& p : *positions) {
    for (int a = 0; a < 3; ++a) {
      lo[a] = p[a] < lo[a] ? p[a] : lo[a];
      hi[a] = p[a] > hi[a] ? p[a] : hi[a];
    }
  }
  return {positions, Vec3(lo[0], lo[1], lo[2]), Vec3(hi[0], hi[1], hi[2]), false};
}

bool sameDisplacement(const VertexMotion* vertices, std::size_t n) {
  for (std::size_t i = 1; i < n; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      if (!(exactDifference(vertices[i].t1[axis], vertices[i].t0[axis]) ==
            exactDifference(vertices[0].t1[axis], vertices[0].t0[axis]))) {
        return false;
      }
    }
  }
  return n > 0;
}

}  // namespace

bool SceneArrays::recordRadii(SceneBody& body, const Body& motion) {
  body.uncertain = false;
  if (!motion.radius_m) return false;
  const std::vector<double>& radius = *motion.radius_m;
  if (radius.size() != body.setup.topology->vertexCount()) {
    throw std::invalid_argument("body '" + body.setup.name + "' needs " +
                                std::to_string(body.setup.topology->vertexCount()) + " uncertainty radii, got " +
                                std::to_string(radius.size()));
  }
  radii_.resize(vertex_count_, 0);
  for (std::size_t i = 0; i < body.usedCount(); ++i) {
    const double r = radius[body.slot_vertex[i]];
    if (!(r >= 0) || !std::isfinite(r)) {
      throw std::invalid_argument("body '" + body.setup.name + "' has uncertainty radius " + std::to_string(r) +
                                  " at vertex " + std::to_string(body.slot_vertex[i]) +
                                  "; it must be finite and not negative");
    }
    radii_[body.internal_begin + i] = r;
    body.uncertain |= r > 0;
  }
  return body.uncertain;
}

/// By coordinates, as isFar() does later of what is recorded.
void SceneArrays::passByFar(const Step& step) {
  const auto mayBePassedBy = [](const SceneBody& body) { return !meetsItself(body.setup) && !meetsMap(body.setup); };
  if (uncertain_ || !keep_bounds_ || std::none_of(bodies_.begin(), bodies_.end(), mayBePassedBy)) return;
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    auto& [from, to] = bodies_[b].extents;
    const Body& motion = step.bodies[b];
    if (from.of != motion.t0) from = to.of == motion.t0 ? to : extentOf(motion.t0);
    if (to.of != motion.t1) to = from.of == motion.t1 ? from : extentOf(motion.t1);
  }
  struct Swept {
    Vec3 lo, hi;  // the upper side with the reach of both bodies, all alike
  };
  std::vector<Swept> swept;
  for (const SceneBody& body : bodies_) {
    Swept one{body.extents[0].lo.cwiseMin(body.extents[1].lo), body.extents[0].hi.cwiseMax(body.extents[1].hi)};
    for (int a = 0; a < 3 && body.reach_m > 0; ++a) {
      one.hi[a] = std::nextafter(one.hi[a] + 2 * body.reach_m, std::numeric_limits<double>::infinity());
    }
    swept.push_back(one);
  }
  const auto apart = [&](std::size_t a, std::size_t b) {
    return (swept[a].hi.array() < swept[b].lo.array()).any() || (swept[b].hi.array() < swept[a].lo.array()).any();
  };
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    SceneBody& body = bodies_[b];
    body.passed_by = mayBePassedBy(body) && body.extents[0].is_finite && body.extents[1].is_finite;
    for (std::size_t other = 0; body.passed_by && other < bodies_.size(); ++other) {
      if (other != b && !apart(b, other)) body.passed_by = !meet(body.setup, b, bodies_[other].setup, other);
    }
  }
}

/// Whether the bounds of the step before are those of what it recorded.
bool SceneArrays::beginRecord(const Step& step, bool may_pass_by) {
  if (step.bodies.size() != bodies_.size()) {
    throw std::invalid_argument("the step has " + std::to_string(step.bodies.size()) + " bodies, the scene " +
                                std::to_string(bodies_.size()));
  }
  const bool valid = bounds_valid_ && keep_bounds_;
  bounds_valid_ = false;  // until refit(), also when a body is refused on the way
  for (std::size_t b = 0; b < bodies_.size(); ++b) checkPositions(bodies_[b], step.bodies[b]);
  uncertain_ = false;
  std::fill(radii_.begin(), radii_.end(), 0.0);
  pieces_.clear();
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    uncertain_ |= recordRadii(bodies_[b], step.bodies[b]);
    bodies_[b].passed_by = false;
  }
  if (may_pass_by) passByFar(step);
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    if (bodies_[b].passed_by) continue;
    const std::size_t n = bodies_[b].usedCount();
    for (std::size_t first = 0; first < n; first += PIECE) pieces_.push_back({b, first, std::min(first + PIECE, n)});
  }
  return valid;
}

/// Small bodies share a unit of work.
std::size_t SceneArrays::piecesInAUnit() const {
  return std::max<std::size_t>(pieces_.size() * PIECE / std::max<std::size_t>(vertex_count_, 1), 1);
}

void SceneArrays::copyPiece(const Step& step, Piece& piece) {
  SceneBody& body = bodies_[piece.body];
  const Vec3* x0 = step.bodies[piece.body].t0->data();
  const Vec3* x1 = step.bodies[piece.body].t1->data();
  VertexMotion* out = vertices_.get() + body.internal_begin;
  // What moves differs at its first vertex already, so that the comparison costs nothing there.
  bool changed = false, same = body.recorded && !body.masked;
  std::size_t unchecked = 0, active_count = 0;
  piece.first_active = piece.last;
  constexpr std::size_t AHEAD = 24;
  for (std::size_t i = piece.first; i < piece.last; ++i) {
    // The vertices lie in the input's order, anywhere in memory: those that come next are fetched meanwhile.
    const Index later = body.slot_vertex[std::min(i + AHEAD, piece.last - 1)];
    __builtin_prefetch(&x0[later]);
    __builtin_prefetch(&x1[later]);
    const Index v = body.slot_vertex[i];
    const Vec3 &p = x0[v], &q = x1[v];
    same = same && std::memcmp(out[i].t0, p.data(), sizeof p) == 0 && std::memcmp(out[i].t1, q.data(), sizeof q) == 0;
    // Not by way of a whole VertexMotion: a load in larger pieces than was written waits for the cache.
    std::memcpy(out[i].t0, p.data(), sizeof p);
    std::memcpy(out[i].t1, q.data(), sizeof q);
    out[i].t0[3] = out[i].t1[3] = 0;
    // A sum of finite terms times zero is zero; anything else is not (and is looked at more closely).
    const double probe = (p[0] * 0 + p[1] * 0 + p[2] * 0) + (q[0] * 0 + q[1] * 0 + q[2] * 0);
    const bool finite = probe == 0;
    unchecked += !finite;
    const bool active = finite && (body.asked.empty() || body.asked[v]);
    changed |= body.active[i] != static_cast<std::uint8_t>(active);
    body.active[i] = active;
    active_count += active;
    if (active && piece.first_active == piece.last) piece.first_active = i;
  }
  piece.same = same;
  piece.changed = changed;
  piece.unchecked = unchecked;
  piece.active = active_count;
}

/// Whether some body is kept.
bool SceneArrays::closeCopies(const Step& step, bool bounds_valid, StepStats& stats) try {
  bool any_kept = false;
  Piece* piece = pieces_.data();
  Piece* const end = piece + pieces_.size();
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    Piece* const begin = piece;
    while (piece != end && piece->body == b) ++piece;
    if (bodies_[b].passed_by) {
      bodies_[b].recorded = bodies_[b].unchanged = bodies_[b].kept = false;
    } else {
      closeCopy(bodies_[b], step.bodies[b], {begin, piece}, bounds_valid, stats);
    }
    any_kept |= bodies_[b].kept;
  }
  return any_kept;
} catch (...) {
  constexpr std::uint8_t NOT_KNOWN = 2;  // other than what the next copy finds: all masks are made anew
  for (SceneBody& body : bodies_) {
    std::fill(body.active.begin(), body.active.end(), NOT_KNOWN);
    body.recorded = false;  // what it is known to be is not of what was copied
  }
  throw;
}

void SceneArrays::closeCopy(SceneBody& body, const Body& motion, const std::array<Piece*, 2>& pieces, bool bounds_valid,
                            StepStats& stats) {
  bool changed = false, same = body.recorded && !body.masked;
  std::size_t unchecked = 0, active = 0, first_active = body.usedCount();
  for (const Piece* piece = pieces[0]; piece != pieces[1]; ++piece) {
    same = same && piece->same;
    changed |= piece->changed;
    unchecked += piece->unchecked;
    active += piece->active;
    if (piece->active > 0) first_active = std::min(first_active, piece->first_active);
  }
  VertexMotion* out = vertices_.get() + body.internal_begin;
  const bool masked = active < body.usedCount();
  if (masked) {
    // What is left out must not widen the range of the records: it takes an active vertex's place.
    for (std::size_t i = 0; i < body.usedCount(); ++i) {
      if (!body.active[i]) out[i] = active > 0 ? out[first_active] : VertexMotion{};
    }
  }
  body.unchanged = same && !masked && !body.uncertain;
  body.kept = body.unchanged && bounds_valid;
  for (Piece* piece = pieces[0]; piece != pieces[1]; ++piece) piece->spans = !body.kept && active > 0;
  if (!body.kept) body.translates = !masked && sameDisplacement(out, body.usedCount());
  body.recorded = !body.uncertain;  // radii widen the bounds, and may be others in the next step
  stats.unchecked_vertices += unchecked;
  sew(body, motion, unchecked == 0);
  if (changed || masked != body.masked) {
    // The mask is indexed by internal vertex number.
    const std::uint8_t* flags = masked ? body.active.data() - body.internal_begin : nullptr;
    for (ClusterTree& tree : body.trees) tree.mask(flags);
    body.masked = masked;
  }
  if (unchecked) {
    for (const Face& f : body.setup.topology->faces()) {
      const auto bad = [&](Index v) { return !(*motion.t0)[v].allFinite() || !(*motion.t1)[v].allFinite(); };
      stats.unchecked_faces += bad(f[0]) || bad(f[1]) || bad(f[2]);
    }
  }
}

/// Seams that hold are kept. A body beside which nothing is near has nobody inside, and is not asked.
void SceneArrays::sew(SceneBody& body, const Body& motion, bool all_finite) const {
  if (body.unchanged && body.sewn_known) return;
  const auto present =
      std::count_if(bodies_.begin(), bodies_.end(), [](const SceneBody& one) { return !one.passed_by; });
  const bool known = all_finite && present > 1;
  body.sewn_known = body.sewn = false;  // should memory end
  if (known && !body.setup.topology->isClosed() && !body.setup.shell) {
    if (body.seams.vertices.empty() || !hold(body.seams, *motion.t0, *motion.t1)) {
      Seams seams = seamsOf(*body.setup.topology, *motion.t0, *motion.t1, body.seams);
      body.seams = Seams();
      body.repeated_slot.clear();
      for (const Index rank : body.rank(FeatureKind::FACE)) {
        if (!seams.vertices.empty()) body.repeated_slot.push_back(seams.repeated[face_order_[rank]]);
      }
      body.seams = std::move(seams);
    }
    body.sewn = !body.seams.vertices.empty();
    if (!body.open_known) {
      body.open_slot.clear();
      const std::vector<std::uint8_t> open = openFaces(*body.setup.topology);
      for (const Index rank : body.rank(FeatureKind::FACE)) {
        if (!open.empty()) body.open_slot.push_back(open[face_order_[rank]]);
      }
      body.open_known = true;
    }
  }
  body.sewn_known = known;
}

void SceneArrays::spanPiece(Piece& piece) const {
  if (!piece.spans) return;
  std::fill_n(piece.bounds_min, 8, std::numeric_limits<double>::infinity());
  std::fill_n(piece.bounds_max, 8, -std::numeric_limits<double>::infinity());
  const VertexMotion* vertices = vertices_.get() + bodies_[piece.body].internal_begin;
  simd::projectionBounds(vertices[piece.first].t0, piece.last - piece.first, piece.bounds_min, piece.bounds_max);
}

void SceneArrays::endRecord(bool any_kept, bool may_scale) {
  for (SceneBody& body : bodies_) {
    if (body.kept) continue;
    std::fill_n(body.bounds_min, 8, std::numeric_limits<double>::infinity());
    std::fill_n(body.bounds_max, 8, -std::numeric_limits<double>::infinity());
  }
  for (const Piece& piece : pieces_) {
    if (!piece.spans) continue;
    SceneBody& body = bodies_[piece.body];
    for (int d = 0; d < 8; ++d) {
      body.bounds_min[d] = std::min(body.bounds_min[d], piece.bounds_min[d]);
      body.bounds_max[d] = std::max(body.bounds_max[d], piece.bounds_max[d]);
    }
  }
  const bool scaled = may_scale && scaleVertices();
  setRange(any_kept && !scaled);
  for (SceneBody& body : bodies_) {
    if (!body.kept) setMargin(body, body.reach_m, body.margin);
    body.rests = body.unchanged && isStill(body) ? std::min(body.rests + 1, RESTS + 1) : 0;
    if (body.rests != RESTS || body.reach_m > 0) continue;
    for (ClusterTree& tree : body.trees) tree.releaseLeaves(records_.data());
  }
}

/// Filters compute in floats, products of many coordinates in doubles: of scenes far from 1 m they could tell nothing.
/// A contact and its time stay the same where all coordinates are multiplied by one number, and by a power of two none
/// is rounded, unless it becomes denormal. Nothing of such a step is kept for the next.
bool SceneArrays::scaleVertices() {
  double largest = 0;
  for (const SceneBody& body : bodies_) {
    for (int k = 0; k < 3; ++k) {
      if (body.bounds_min[k] > body.bounds_max[k]) continue;  // nothing of it is recorded
      largest = std::max({largest, std::abs(body.bounds_min[k]), std::abs(body.bounds_max[k])});
    }
    if (body.reach_m > 0) return false;
  }
  const bool fits = largest >= tolerance::SCENE_SMALLEST_M && largest <= tolerance::SCENE_LARGEST_M;
  if (uncertain_ || fits || largest == 0) return false;
  const int up = -std::ilogb(largest);
  const auto forEach = [&](const auto& f) {
    for (const SceneBody& body : bodies_) {
      if (body.passed_by) continue;
      VertexMotion* const vertices = vertices_.get() + body.internal_begin;
      for (std::size_t i = 0; i < body.usedCount(); ++i) {
        for (int k = 0; k < 3; ++k) f(vertices[i].t0[k]), f(vertices[i].t1[k]);
      }
    }
  };
  bool rounds = false;
  forEach([&](double x) { rounds = rounds || std::ldexp(std::ldexp(x, up), -up) != x; });
  if (rounds) return false;
  forEach([&](double& x) { x = std::ldexp(x, up); });
  for (SceneBody& body : bodies_) {
    body.kept = body.recorded = false;
    for (int d = 0; d < 8; ++d) {
      body.bounds_min[d] = std::ldexp(body.bounds_min[d], up);
      body.bounds_max[d] = std::ldexp(body.bounds_max[d], up);
    }
  }
  return true;
}

/// What the records span. Where some body rests, the range is wider than needed and stays for as long as it holds the
/// scene, since with another range that body's records would be other ones.
void SceneArrays::setRange(bool keep) {
  double low[8], high[8];
  std::fill_n(low, 8, std::numeric_limits<double>::infinity());
  std::fill_n(high, 8, -std::numeric_limits<double>::infinity());
  for (const SceneBody& body : bodies_) {
    for (int d = 0; d < 8; ++d) {
      low[d] = std::min(low[d], body.bounds_min[d]);
      high[d] = std::max(high[d], body.bounds_max[d]);
    }
  }
  bool holds = keep && range_padded_;
  for (int d = 0; d < 8; ++d) {
    const double spanned = range_max_[d] - range_min_[d];
    holds =
        holds && low[d] >= range_min_[d] && high[d] <= range_max_[d] && high[d] - low[d] >= SMALLEST_SHARE * spanned;
  }
  if (holds) return;
  for (SceneBody& body : bodies_) body.kept = false;
  range_padded_ = keep;
  for (int d = 0; d < 8; ++d) {
    // Half ranges: a difference of finite doubles can overflow. The scale only has to be positive and finite.
    const double pad = keep ? PADDING * (high[d] - low[d]) : 0;
    range_min_[d] = low[d] - pad;
    range_max_[d] = high[d] + pad;
    const double range = range_max_[d] / 2 - range_min_[d] / 2;
    const bool usable =
        range > 0 && std::isfinite(range_min_[d]) && std::isfinite(range_max_[d]) && std::isfinite(2 * range);
    low_[d] = usable ? range_min_[d] : 0;
    scale_[d] = usable ? std::min(simd::RECORD_RANGE / 2 / range, 1e300) : 0;
  }
}

/// How many record units `reach_m` is, rounded up. Both bodies of a pair are widened, each by half of the separation
/// and by its own radii; the sum of the two margins is never less than what the pair asks for, since a margin that does
/// not fit is UNBOUNDED. (Cut off at half the range, one alone would not reach from one end of the records to the
/// other.)
void SceneArrays::setMargin(const SceneBody& body, double reach_m, std::uint16_t* margin16) const {
  if (!(reach_m > 0) && body.reach_m == 0) {
    std::fill_n(margin16, 16, std::uint16_t{0});
    return;
  }
  for (int k = 0; k < 16; ++k) {
    const int d = k % 8;
    const double length = d < 3 ? 1.0 : tolerance::SQRT2_UP;
    // The rounding of both sums, enough where one side alone is widened, and a unit for the truncation of both values.
    // Strict comparisons of whole numbers need nothing of that unit, so that it also holds the five roundings of the
    // distance itself, which are below 2^-35 units.
    const double rounding =
        tolerance::RECORD_MARGIN * std::max(std::abs(range_min_[d]), std::abs(range_max_[d])) * scale_[d];
    const double units = std::ceil(reach_m * length * scale_[d] + rounding) + 1;
    margin16[k] = static_cast<std::uint16_t>(scale_[d] > 0 ? std::min<double>(units, simd::UNBOUNDED) : 0);
  }
}

void SceneArrays::quantize(std::size_t first, std::size_t last) {
  if (first == last) return;  // a body without edges has no vertices here, and a scene of such no array
  simd::quantize(vertices_[first].t0, last - first, low_, scale_, records_.data() + first * simd::RECORD);
}

void SceneArrays::refitLeaves(const SceneBody& body, ClusterTree& tree, std::size_t first, std::size_t last) const {
  if (!body.uncertain) return tree.refitLeaves(records_.data(), body.reach_m > 0 ? body.margin : nullptr, first, last);
  // Only groups with an uncertain vertex are widened further, by the largest radius in them.
  std::uint16_t margin[16];
  for (std::size_t group = first; group < last; ++group) {
    const std::size_t end = std::min((group + 1) * simd::GROUP, tree.featureCount()) * tree.arity();
    double radius = 0;
    for (std::size_t i = group * simd::GROUP * tree.arity(); i < end; ++i) {
      radius = std::max(radius, radii_[tree.feature(0)[i]]);
    }
    setMargin(body, body.reach_m + radius, margin);
    tree.refitLeaves(records_.data(), margin, group, group + 1);
  }
}

}  // namespace dccd
