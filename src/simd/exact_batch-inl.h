// The batched elementary test, compiled once per SIMD target (no include guard: foreach_target includes it anew).
// Three passes over blocks of 64 pairs:
//   reject    differences, Bernstein coefficients of f, quick "no"; the rest is copied side by side (RootBlock);
//   classify  pieces of the step that hold one root, none, or an uncertain number;
//   refine    each first root: a few Halley steps, a bracket certified by signs, the inside test over the bracket.
// With CERTIFIED false all bounds are zero and nothing is certified; the rest is the same.
// No MulAdd, no reciprocal estimate: every target computes the same bits.
#include "simd/exact_batch.h"
#include "simd/exact_batch_bounds.h"
#include "simd/exact_batch_scratch.h"

HWY_BEFORE_NAMESPACE();
namespace deformable_ccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<double, 8>;
using V = hn::Vec<Tag>;
using M = hn::Mask<Tag>;

constexpr int QUICK_STEPS = 4;      ///< Halley steps that settle nearly every root
constexpr int PATIENT_STEPS = 64;   ///< for the others: enough for bisection alone

HWY_INLINE V load(const double* plane, std::size_t i) { return hn::Load(Tag(), plane + i); }
HWY_INLINE void store(V v, double* plane, std::size_t i) { hn::Store(v, Tag(), plane + i); }
HWY_INLINE V constant(double x) { return hn::Set(Tag(), x); }

/// x y - z w with two roundings of products and one of the difference.
HWY_INLINE V minor(V x, V y, V z, V w) { return hn::Sub(hn::Mul(x, y), hn::Mul(z, w)); }
HWY_INLINE V dot(V ax, V ay, V az, V bx, V by, V bz) {
  return hn::Add(hn::Add(hn::Mul(ax, bx), hn::Mul(ay, by)), hn::Mul(az, bz));
}
HWY_INLINE V lerp(V p, V q, V s, V t) { return hn::Add(hn::Mul(p, s), hn::Mul(q, t)); }
HWY_INLINE V onGrid(V t) { return hn::Sub(hn::Add(t, constant(1)), constant(1)); }  ///< multiples of 2^-52 in [0,1]

/// f at multiples of 2^-52 in [0,1], within the bound of exact_batch_bounds.h.
HWY_INLINE V evaluate(V f0, V f1, V f2, V f3, V t) {
  const V s = hn::Sub(constant(1), t);
  const V tt = hn::Mul(t, t);
  const V low = hn::Add(hn::Mul(lerp(f0, f1, s, t), s), hn::Mul(f2, tt));
  return hn::Add(hn::Mul(low, s), hn::Mul(f3, hn::Mul(tt, t)));
}

template <bool CERTIFIED>
HWY_INLINE M isPositive(V f, V error) {
  return CERTIFIED ? hn::Gt(f, error) : hn::Ge(f, hn::Zero(Tag()));
}
template <bool CERTIFIED>
HWY_INLINE M isNegative(V f, V error) {
  return hn::Lt(f, CERTIFIED ? hn::Neg(error) : hn::Zero(Tag()));
}

/// Largest absolute component of a difference over both ends.
HWY_INLINE V sizeOf(const double (*motion)[BATCH_STRIDE], int t0, int t1, std::size_t i) {
  const V a = hn::Max(hn::Abs(load(motion[t0], i)), hn::Abs(load(motion[t1], i)));
  const V b = hn::Max(hn::Abs(load(motion[t0 + 1], i)), hn::Abs(load(motion[t1 + 1], i)));
  const V c = hn::Max(hn::Abs(load(motion[t0 + 2], i)), hn::Abs(load(motion[t1 + 2], i)));
  return hn::Max(hn::Max(a, b), c);
}

HWY_INLINE M withinGuard(V size) {
  return hn::And(hn::Ge(size, constant(BATCH_SMALLEST)), hn::Le(size, constant(BATCH_LARGEST)));
}

/// Fills the last vector of planes up with copies of its last pair, so that no lane holds garbage.
template <std::size_t PLANES>
HWY_INLINE void pad(double (&planes)[PLANES][BATCH_STRIDE], std::size_t count) {
  const std::size_t end = (count + hn::Lanes(Tag()) - 1) / hn::Lanes(Tag()) * hn::Lanes(Tag());
  for (std::size_t j = count; j < end; ++j) {
    for (std::size_t k = 0; k < PLANES; ++k) planes[k][j] = planes[k][count - 1];
  }
}

/// Differences of pairs first .. first+count as planes. Plain doubles: scattered stores beat gathers on most machines.
template <BatchKind KIND>
HWY_INLINE void gather(const BatchInput& in, std::size_t first, std::size_t count, MotionBlock& block) {
  constexpr std::size_t AHEAD = 16;
  for (std::size_t j = 0; j < count; ++j) {
    const std::uint32_t* quad = in.quads[first + j];
    if (first + j + AHEAD < in.count) {
      const std::uint32_t* later = in.quads[first + j + AHEAD];
      for (int i = 0; i < 4; ++i) hwy::Prefetch(in.vertices + std::size_t{8} * later[i]);
    }
    const double* x[4];
    for (int i = 0; i < 4; ++i) x[i] = in.vertices + std::size_t{8} * quad[i];
    constexpr bool VF = KIND == BatchKind::VERTEX_FACE;
    const double* u[2] = {x[VF ? 2 : 1], x[VF ? 1 : 0]};  // from minus to
    const double* v[2] = {x[3], x[VF ? 1 : 2]};
    const double* w[2] = {x[VF ? 0 : 2], x[VF ? 1 : 0]};
    for (int k = 0; k < 3; ++k) {
      block.motion[U_T0 + k][j] = u[0][k] - u[1][k];
      block.motion[V_T0 + k][j] = v[0][k] - v[1][k];
      block.motion[W_T0 + k][j] = w[0][k] - w[1][k];
      block.motion[U_T1 + k][j] = u[0][4 + k] - u[1][4 + k];
      block.motion[V_T1 + k][j] = v[0][4 + k] - v[1][4 + k];
      block.motion[W_T1 + k][j] = w[0][4 + k] - w[1][4 + k];
    }
  }
  pad(block.motion, count);
}

/// Bernstein coefficients and sizes of one vector of pairs; returns the lanes that are certainly free of contact
/// because f keeps one sign.
template <bool CERTIFIED>
HWY_INLINE M coefficients(const MotionBlock& block, std::size_t i, V& f0, V& f1, V& f2, V& f3, V& size_u, V& size_v,
                          V& size_w) {
  const auto& m = block.motion;
  const V ux0 = load(m[U_T0], i), uy0 = load(m[U_T0 + 1], i), uz0 = load(m[U_T0 + 2], i);
  const V vx0 = load(m[V_T0], i), vy0 = load(m[V_T0 + 1], i), vz0 = load(m[V_T0 + 2], i);
  const V ux1 = load(m[U_T1], i), uy1 = load(m[U_T1 + 1], i), uz1 = load(m[U_T1 + 2], i);
  const V vx1 = load(m[V_T1], i), vy1 = load(m[V_T1 + 1], i), vz1 = load(m[V_T1 + 2], i);
  const V nx0 = minor(uy0, vz0, uz0, vy0), ny0 = minor(uz0, vx0, ux0, vz0), nz0 = minor(ux0, vy0, uy0, vx0);
  const V nx2 = minor(uy1, vz1, uz1, vy1), ny2 = minor(uz1, vx1, ux1, vz1), nz2 = minor(ux1, vy1, uy1, vx1);
  const V mx = hn::Add(minor(uy0, vz1, uz0, vy1), minor(uy1, vz0, uz1, vy0));
  const V my = hn::Add(minor(uz0, vx1, ux0, vz1), minor(uz1, vx0, ux1, vz0));
  const V mz = hn::Add(minor(ux0, vy1, uy0, vx1), minor(ux1, vy0, uy1, vx0));
  const V wx0 = load(m[W_T0], i), wy0 = load(m[W_T0 + 1], i), wz0 = load(m[W_T0 + 2], i);
  const V wx1 = load(m[W_T1], i), wy1 = load(m[W_T1 + 1], i), wz1 = load(m[W_T1 + 2], i);
  f0 = dot(nx0, ny0, nz0, wx0, wy0, wz0);
  f1 = hn::Add(dot(mx, my, mz, wx0, wy0, wz0), dot(nx0, ny0, nz0, wx1, wy1, wz1));
  f2 = hn::Add(dot(mx, my, mz, wx1, wy1, wz1), dot(nx2, ny2, nz2, wx0, wy0, wz0));
  f3 = dot(nx2, ny2, nz2, wx1, wy1, wz1);
  if (!CERTIFIED) {
    const V zero = hn::Zero(Tag());  // comparisons only: they treat NaN (overflow) alike on every target
    const M plus = hn::Or(hn::Or(hn::Ge(f0, zero), hn::Ge(f1, zero)), hn::Or(hn::Ge(f2, zero), hn::Ge(f3, zero)));
    const M minus = hn::Or(hn::Or(hn::Lt(f0, zero), hn::Lt(f1, zero)), hn::Or(hn::Lt(f2, zero), hn::Lt(f3, zero)));
    return hn::Not(hn::And(plus, minus));
  }
  size_u = sizeOf(m, U_T0, U_T1, i);
  size_v = sizeOf(m, V_T0, V_T1, i);
  size_w = sizeOf(m, W_T0, W_T1, i);
  const V volume = hn::Mul(hn::Mul(size_u, size_v), size_w);
  const V end_error = hn::Mul(constant(BATCH_END_ERROR), volume);
  const V middle_error = hn::Mul(constant(BATCH_MIDDLE_ERROR), volume);
  const V least = hn::Min(hn::Sub(hn::Min(f0, f3), end_error), hn::Sub(hn::Min(f1, f2), middle_error));
  const V most = hn::Max(hn::Add(hn::Max(f0, f3), end_error), hn::Add(hn::Max(f1, f2), middle_error));
  const M guard = hn::And(hn::And(withinGuard(size_u), withinGuard(size_v)), withinGuard(size_w));
  return hn::And(guard, hn::Or(hn::Gt(least, hn::Zero(Tag())), hn::Lt(most, hn::Zero(Tag()))));
}

/// First pass: quick "no" is written out, the rest copied into `roots` side by side.
template <bool CERTIFIED>
HWY_INLINE void reject(const MotionBlock& block, std::size_t first, std::size_t count, const BatchOutput& out,
                       RootBlock& roots) {
  const std::size_t lanes = hn::Lanes(Tag());
  HWY_ALIGN double f[4][8];
  HWY_ALIGN double size[3][8];
  roots.count = 0;
  for (std::size_t i = 0; i < count; i += lanes) {
    V f0, f1, f2, f3;
    V size_u = hn::Zero(Tag()), size_v = size_u, size_w = size_u;
    const M no = coefficients<CERTIFIED>(block, i, f0, f1, f2, f3, size_u, size_v, size_w);
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(Tag(), no, bits);
    const std::size_t used = count - i < lanes ? count - i : lanes;
    unsigned rest = ~static_cast<unsigned>(bits[0]) & ((1u << used) - 1);
    std::memset(out.verdict + first + i, BATCH_NO, used);
    if (rest == 0) continue;
    store(f0, f[0], 0), store(f1, f[1], 0), store(f2, f[2], 0), store(f3, f[3], 0);
    if (CERTIFIED) store(size_u, size[0], 0), store(size_v, size[1], 0), store(size_w, size[2], 0);
    for (; rest != 0; rest &= rest - 1) {
      const std::size_t j = hwy::Num0BitsBelowLS1Bit_Nonzero32(rest);
      const std::size_t to = roots.count++;
      for (int k = 0; k < MOTION_PLANES; ++k) roots.motion[k][to] = block.motion[k][i + j];
      for (int k = 0; k < 4; ++k) roots.coefficient[k][to] = f[k][j];
      for (int k = 0; CERTIFIED && k < 3; ++k) roots.size[k][to] = size[k][j];
      roots.pair[to] = static_cast<std::uint32_t>(first + i + j);
    }
  }
  if (roots.count == 0) return;
  pad(roots.motion, roots.count);
  pad(roots.coefficient, roots.count);
  if (CERTIFIED) pad(roots.size, roots.count);
}

/// Two places that split [0,1] into pieces on which the Bernstein coefficients of f are monotone: the extrema of f, or
/// its inflection point where it has none. Any place is safe; these leave no piece uncertain without need.
HWY_INLINE void splits(V f0, V f1, V f2, V f3, V& first, V& second) {
  const V zero = hn::Zero(Tag()), one = constant(1), three = constant(3);
  const V a1 = hn::Sub(f1, hn::Mul(three, f0));
  const V a2 = hn::Add(hn::Sub(hn::Mul(three, f0), hn::Add(f1, f1)), f2);
  const V a3 = hn::Mul(three, hn::Add(hn::Sub(f3, f2), hn::Sub(f1, f0)));
  const V discriminant = hn::Sub(hn::Mul(a2, a2), hn::Mul(a3, a1));
  const V root = hn::Sqrt(hn::IfThenElse(hn::Gt(discriminant, zero), discriminant, zero));
  const V q = hn::Neg(hn::IfThenElse(hn::Lt(a2, zero), hn::Sub(a2, root), hn::Add(a2, root)));
  const V p1 = hn::Div(q, a3), p2 = hn::Div(a1, q);
  // Outside (0,1), NaN included: the end 0, which makes an empty piece.
  const V t1 = hn::IfThenElse(hn::And(hn::Gt(p1, zero), hn::Lt(p1, one)), onGrid(p1), zero);
  const V t2 = hn::IfThenElse(hn::And(hn::Gt(p2, zero), hn::Lt(p2, one)), onGrid(p2), zero);
  const M swap = hn::Gt(t1, t2);
  first = hn::IfThenElse(swap, t2, t1);
  second = hn::IfThenElse(swap, t1, t2);
}

/// Bernstein coefficients of f over [a, b] by de Casteljau's algorithm, from f0, f1, f2, f3 (not three times f1, f2).
HWY_INLINE void restrict(V f0, V f1, V f2, V f3, V a, V b, V& c0, V& c1, V& c2, V& c3) {
  const V sa = hn::Sub(constant(1), a), sb = hn::Sub(constant(1), b);
  const V a0 = lerp(f0, f1, sa, a), a1 = lerp(f1, f2, sa, a), a2 = lerp(f2, f3, sa, a);
  const V b0 = lerp(f0, f1, sb, b), b1 = lerp(f1, f2, sb, b), b2 = lerp(f2, f3, sb, b);
  const V aa0 = lerp(a0, a1, sa, a), aa1 = lerp(a1, a2, sa, a);
  const V bb0 = lerp(b0, b1, sb, b), bb1 = lerp(b1, b2, sb, b);
  c0 = lerp(aa0, aa1, sa, a);
  c1 = lerp(aa0, aa1, sb, b);
  c2 = lerp(bb0, bb1, sa, a);
  c3 = lerp(bb0, bb1, sb, b);
}

/// What Descartes' rule says of a piece with these coefficients. Exactly one sign change whatever the uncertain
/// middle ones are: c1 has c0's sign for certain, or c2 has c3's. With BY_ENDS only the ends are looked at (pieces on
/// which f is monotone up to rounding, where nothing is to be proved).
template <bool CERTIFIED, bool BY_ENDS>
HWY_INLINE V pieceOf(V c0, V c1, V c2, V c3, V error) {
  const M p0 = isPositive<CERTIFIED>(c0, error), n0 = isNegative<CERTIFIED>(c0, error);
  const M p3 = isPositive<CERTIFIED>(c3, error), n3 = isNegative<CERTIFIED>(c3, error);
  M one_root = hn::Or(hn::And(p0, n3), hn::And(n0, p3));
  M free = hn::Or(hn::And(p0, p3), hn::And(n0, n3));
  if (!BY_ENDS) {
    const M p1 = isPositive<CERTIFIED>(c1, error), n1 = isNegative<CERTIFIED>(c1, error);
    const M p2 = isPositive<CERTIFIED>(c2, error), n2 = isNegative<CERTIFIED>(c2, error);
    one_root = hn::Or(hn::And(hn::And(p0, n3), hn::Or(p1, n2)), hn::And(hn::And(n0, p3), hn::Or(n1, p2)));
    free = hn::Or(hn::And(hn::And(p0, p1), hn::And(p2, p3)), hn::And(hn::And(n0, n1), hn::And(n2, n3)));
  }
  return hn::IfThenElse(one_root, constant(PIECE_ROOT),
                        hn::IfThenElse(free, constant(PIECE_FREE), constant(PIECE_UNCERTAIN)));
}

/// Makes the first piece from `piece` on that is not free the current one, or settles the pair.
inline void selectPiece(RootBlock& roots, std::size_t j, int piece) {
  while (piece < 3 && roots.piece[piece][j] == PIECE_FREE) ++piece;
  roots.current[j] = static_cast<std::uint8_t>(piece);
  if (piece >= 3) {
    roots.outcome[j] = ROOT_NO_CONTACT;
    return;
  }
  roots.outcome[j] = roots.piece[piece][j] == PIECE_ROOT ? ROOT_PENDING : ROOT_UNCERTAIN;
  roots.lo[j] = roots.end[piece][j];
  roots.hi[j] = roots.end[piece + 1][j];
  roots.at_lo[j] = roots.value[piece][j];
  roots.at_hi[j] = roots.value[piece + 1][j];
}

/// Second pass, one vector: the pieces of the step and the first root to look for.
template <bool CERTIFIED>
HWY_INLINE void classify(RootBlock& roots, std::size_t i) {
  const Tag d;
  const V zero = hn::Zero(d), one = constant(1), third = constant(1.0 / 3);
  const V f0 = load(roots.coefficient[0], i), f3 = load(roots.coefficient[3], i);
  const V f1_times_3 = load(roots.coefficient[1], i), f2_times_3 = load(roots.coefficient[2], i);
  const V f1 = hn::Mul(f1_times_3, third), f2 = hn::Mul(f2_times_3, third);
  V error = zero;
  if (CERTIFIED) {
    const V size_u = load(roots.size[0], i), size_v = load(roots.size[1], i), size_w = load(roots.size[2], i);
    const V largest = hn::Max(hn::Max(hn::Abs(f0), hn::Abs(f1)), hn::Max(hn::Abs(f2), hn::Abs(f3)));
    const M guard = hn::And(hn::And(withinGuard(size_u), withinGuard(size_v)), withinGuard(size_w));
    const V volume = hn::Mul(hn::Mul(size_u, size_v), size_w);
    const V bound = hn::Add(hn::Mul(constant(BATCH_VALUE_ERROR), volume),
                            hn::Mul(constant(BATCH_VALUE_ROUNDING), largest));
    error = hn::IfThenElse(guard, bound, constant(std::numeric_limits<double>::infinity()));
  }
  store(error, roots.error, i);
  const V whole = pieceOf<CERTIFIED, false>(f0, f1, f2, f3, error);
  store(whole, roots.piece[0], i);
  store(hn::Zero(d), roots.lo, i);
  store(constant(1), roots.hi, i);
  store(f0, roots.at_lo, i);
  store(f3, roots.at_hi, i);
  store(constant(ROOT_PENDING), roots.outcome, i);
  const std::size_t lanes = hn::Lanes(d);
  std::memset(roots.current + i, 2, lanes);  // no other piece to go on with
  if (hn::AllTrue(d, hn::Eq(whole, constant(PIECE_ROOT)))) return;

  V t1, t2;
  splits(f0, f1_times_3, f2_times_3, f3, t1, t2);
  store(zero, roots.end[0], i);
  store(t1, roots.end[1], i);
  store(t2, roots.end[2], i);
  store(one, roots.end[3], i);
  store(f3, roots.value[3], i);
  for (int k = 0; k < 3; ++k) {
    V c0, c1, c2, c3;
    restrict(f0, f1, f2, f3, load(roots.end[k], i), load(roots.end[k + 1], i), c0, c1, c2, c3);
    store(pieceOf<CERTIFIED, !CERTIFIED>(c0, c1, c2, c3, error), roots.piece[k], i);
    store(c0, roots.value[k], i);
  }
  HWY_ALIGN double single[8];
  store(whole, single, 0);
  for (std::size_t j = 0; j < lanes; ++j) {
    if (single[j] != PIECE_ROOT) selectPiece(roots, i + j, 0);
  }
}

/// The inside test at t = x, for every t within h of it: lanes that certainly touch there and lanes that certainly
/// do not. On the coordinate plane where n = u x v is largest; with B and C as below the closed features meet iff
///   VF  B/n, C/n and (n-B-C)/n >= 0 (barycentric coordinates),
///   EE  B/n, C/n, (n-B)/n and (n-C)/n >= 0 (line parameters of both edges).
template <bool CERTIFIED, BatchKind KIND>
HWY_INLINE void insideTest(const RootBlock& roots, std::size_t i, V x, V h, M& touches, M& misses) {
  const V s = hn::Sub(constant(1), x);
  const auto& m = roots.motion;
  const V ux = lerp(load(m[U_T0], i), load(m[U_T1], i), s, x);
  const V uy = lerp(load(m[U_T0 + 1], i), load(m[U_T1 + 1], i), s, x);
  const V uz = lerp(load(m[U_T0 + 2], i), load(m[U_T1 + 2], i), s, x);
  const V vx = lerp(load(m[V_T0], i), load(m[V_T1], i), s, x);
  const V vy = lerp(load(m[V_T0 + 1], i), load(m[V_T1 + 1], i), s, x);
  const V vz = lerp(load(m[V_T0 + 2], i), load(m[V_T1 + 2], i), s, x);
  const V wx = lerp(load(m[W_T0], i), load(m[W_T1], i), s, x);
  const V wy = lerp(load(m[W_T0 + 1], i), load(m[W_T1 + 1], i), s, x);
  const V wz = lerp(load(m[W_T0 + 2], i), load(m[W_T1 + 2], i), s, x);
  const V nx = minor(uy, vz, uz, vy), ny = minor(uz, vx, ux, vz), nz = minor(ux, vy, uy, vx);
  const V ax = hn::Abs(nx), ay = hn::Abs(ny), az = hn::Abs(nz);
  const M on_x = hn::And(hn::Ge(ax, ay), hn::Ge(ax, az));
  const M on_y = hn::Ge(ay, az);  // where not on_x
  const V n = hn::IfThenElse(on_x, nx, hn::IfThenElse(on_y, ny, nz));
  const V u1 = hn::IfThenElse(on_x, uy, hn::IfThenElse(on_y, uz, ux));
  const V u2 = hn::IfThenElse(on_x, uz, hn::IfThenElse(on_y, ux, uy));
  const V v1 = hn::IfThenElse(on_x, vy, hn::IfThenElse(on_y, vz, vx));
  const V v2 = hn::IfThenElse(on_x, vz, hn::IfThenElse(on_y, vx, vy));
  const V w1 = hn::IfThenElse(on_x, wy, hn::IfThenElse(on_y, wz, wx));
  const V w2 = hn::IfThenElse(on_x, wz, hn::IfThenElse(on_y, wx, wy));
  const V flip = hn::And(n, hn::SignBit(Tag()));  // makes n positive
  const V nn = hn::Abs(n);
  const V b = hn::Xor(minor(w1, v2, w2, v1), flip);
  const V c = hn::Xor(KIND == BatchKind::VERTEX_FACE ? minor(u1, w2, u2, w1) : minor(w1, u2, w2, u1), flip);
  V error_n = hn::Zero(Tag()), error_b = error_n, error_c = error_n;
  if (CERTIFIED) {
    const V size_u = load(roots.size[0], i), size_v = load(roots.size[1], i), size_w = load(roots.size[2], i);
    const V relative = hn::Add(constant(BATCH_MINOR_ERROR), hn::Mul(constant(BATCH_MINOR_SLOPE), h));
    error_n = hn::Mul(hn::Mul(size_u, size_v), relative);
    error_b = hn::Mul(hn::Mul(size_v, size_w), relative);
    error_c = hn::Mul(hn::Mul(size_u, size_w), relative);
  }
  const M n_certain = hn::Gt(nn, error_n);
  M all_inside = hn::And(isPositive<CERTIFIED>(b, error_b), isPositive<CERTIFIED>(c, error_c));
  M any_outside = hn::Or(isNegative<CERTIFIED>(b, error_b), isNegative<CERTIFIED>(c, error_c));
  if (KIND == BatchKind::VERTEX_FACE) {
    const V a = hn::Sub(hn::Sub(nn, b), c), error_a = hn::Add(hn::Add(error_n, error_b), error_c);
    all_inside = hn::And(all_inside, isPositive<CERTIFIED>(a, error_a));
    any_outside = hn::Or(any_outside, isNegative<CERTIFIED>(a, error_a));
  } else {
    const V nb = hn::Sub(nn, b), error_nb = hn::Add(error_n, error_b);
    const V nc = hn::Sub(nn, c), error_nc = hn::Add(error_n, error_c);
    all_inside = hn::And(all_inside, hn::And(isPositive<CERTIFIED>(nb, error_nb), isPositive<CERTIFIED>(nc, error_nc)));
    any_outside = hn::Or(any_outside, hn::Or(isNegative<CERTIFIED>(nb, error_nb), isNegative<CERTIFIED>(nc, error_nc)));
  }
  touches = hn::And(n_certain, all_inside);
  misses = hn::And(n_certain, any_outside);
}

/// Largest integer not above y, for 0 <= y <= 2^52; exact, and the same instructions on every target.
HWY_INLINE V floorOf(V y) {
  const V big = constant(0x1p52);
  const V nearest = hn::Sub(hn::Add(y, big), big);
  return hn::IfThenElse(hn::Gt(nearest, y), hn::Sub(nearest, constant(1)), nearest);
}

/// Approximate root in [lo, hi] by `steps` Halley steps that fall back to bisection, and |f'| there.
HWY_INLINE V approximateRoot(V f0, V f1, V f2, V f3, V lo, V hi, V at_lo, V at_hi, int steps, V& slope, V& curvature) {
  const V three = constant(3), half = constant(0.5), sign_bit = hn::SignBit(Tag());
  const V a1 = hn::Sub(f1, hn::Mul(three, f0));
  const V a2 = hn::Add(hn::Sub(hn::Mul(three, f0), hn::Add(f1, f1)), f2);
  const V a3 = hn::Add(hn::Sub(f3, f2), hn::Sub(f1, f0));
  const V a3_times_3 = hn::Mul(three, a3);
  const V flip = hn::And(at_lo, sign_bit);  // makes f positive at lo
  const V zero = hn::Zero(Tag());
  V x = hn::Add(lo, hn::Div(hn::Mul(hn::Sub(hi, lo), at_lo), hn::Sub(at_lo, at_hi)));
  V d = zero, c = zero;
  for (int step = 0; step < steps; ++step) {
    const V f = hn::Add(hn::Mul(hn::Add(hn::Mul(hn::Add(hn::Mul(a3, x), a2), x), a1), x), f0);
    c = hn::Add(hn::Mul(a3_times_3, x), a2);                // f''/2
    d = hn::Add(hn::Mul(hn::Add(c, a2), x), a1);            // f'
    const M before = hn::Gt(hn::Xor(f, flip), zero);        // the root lies beyond x
    lo = hn::IfThenElse(before, x, lo);
    hi = hn::IfThenElse(before, hi, x);
    const V next = hn::Sub(x, hn::Div(hn::Mul(f, d), hn::Sub(hn::Mul(d, d), hn::Mul(f, c))));
    const M inside = hn::And(hn::Ge(next, lo), hn::Le(next, hi));
    x = hn::IfThenElse(inside, next, hn::Mul(half, hn::Add(lo, hi)));
  }
  slope = hn::Abs(d);
  curvature = hn::Abs(c);
  return onGrid(x);
}

/// One vector of the third pass: approximates the current root, certifies a bracket and the cell, and tests for contact.
template <bool CERTIFIED, BatchKind KIND>
HWY_INLINE void refine(RootBlock& roots, std::size_t i, double cells, int steps) {
  const V f0 = load(roots.coefficient[0], i), f1 = load(roots.coefficient[1], i);
  const V f2 = load(roots.coefficient[2], i), f3 = load(roots.coefficient[3], i);
  const V lo = load(roots.lo, i), hi = load(roots.hi, i), at_lo = load(roots.at_lo, i);
  V slope, curvature;
  const V x = approximateRoot(f0, f1, f2, f3, lo, hi, at_lo, load(roots.at_hi, i), steps, slope, curvature);
  const V count = constant(cells), width = constant(1 / cells), one = constant(1);
  M touches, misses;
  V outcome = constant(ROOT_UNCERTAIN);
  V root_lo = x, root_hi = x;
  if (!CERTIFIED) {
    insideTest<CERTIFIED, KIND>(roots, i, x, x, touches, misses);
    outcome = hn::IfThenElse(touches, constant(ROOT_CONTACT), constant(ROOT_NO_CONTACT));
  } else {
    const V error = load(roots.error, i);
    const V flip = hn::And(at_lo, hn::SignBit(Tag()));
    V reach = hn::Div(hn::Mul(constant(4), error), slope);
    if (steps != QUICK_STEPS) {  // near a double root the curvature bounds the reach better than the slope
      const V parabola = hn::Sqrt(hn::Div(hn::Mul(constant(16), error), curvature));
      reach = hn::Mul(constant(4), reach);
      reach = hn::IfThenElse(hn::Lt(parabola, reach), parabola, reach);
    }
    reach = hn::Add(reach, constant(0x1p-50));
    const V below = onGrid(hn::Sub(x, reach)), above = onGrid(hn::Add(x, reach));
    root_lo = hn::IfThenElse(hn::Gt(below, lo), below, lo);
    root_hi = hn::IfThenElse(hn::Lt(above, hi), above, hi);
    const M bracketed = hn::And(hn::Gt(hn::Xor(evaluate(f0, f1, f2, f3, root_lo), flip), error),
                                hn::Lt(hn::Xor(evaluate(f0, f1, f2, f3, root_hi), flip), hn::Neg(error)));
    insideTest<CERTIFIED, KIND>(roots, i, x, hn::Sub(root_hi, root_lo), touches, misses);
    outcome = hn::IfThenElse(misses, constant(ROOT_NO_CONTACT), outcome);
    outcome = hn::IfThenElse(touches, constant(ROOT_CONTACT_NO_CELL), outcome);
    // At most one border between cells lies in the bracket unless cells are very fine; f's sign there tells the side.
    const V border = hn::Mul(hn::Add(floorOf(hn::Mul(root_lo, count)), one), width);
    const V at_border = hn::Xor(evaluate(f0, f1, f2, f3, border), flip);
    const M straddles = hn::Lt(border, root_hi);
    root_lo = hn::IfThenElse(hn::And(straddles, hn::Gt(at_border, error)), border, root_lo);
    root_hi = hn::IfThenElse(hn::And(straddles, hn::Lt(at_border, hn::Neg(error))), border, root_hi);
    const V end_of_cell = hn::Add(floorOf(hn::Mul(root_lo, count)), one);
    const M in_one_cell = hn::Le(hn::Mul(root_hi, count), end_of_cell);
    outcome = hn::IfThenElse(hn::And(touches, in_one_cell), constant(ROOT_CONTACT), outcome);
    outcome = hn::IfThenElse(bracketed, outcome, constant(ROOT_NOT_BRACKETED));
  }
  const V previous = load(roots.outcome, i);
  store(hn::IfThenElse(hn::Eq(previous, constant(ROOT_PENDING)), outcome, previous), roots.outcome, i);
  store(root_lo, roots.root_lo, i);
  store(root_hi, roots.root_hi, i);
}

/// Copies one lane with everything that is known of it.
inline void copyLane(const RootBlock& from, std::size_t i, RootBlock& to, std::size_t j) {
  for (int k = 0; k < MOTION_PLANES; ++k) to.motion[k][j] = from.motion[k][i];
  for (int k = 0; k < 4; ++k) {
    to.coefficient[k][j] = from.coefficient[k][i];
    to.end[k][j] = from.end[k][i];
    to.value[k][j] = from.value[k][i];
  }
  for (int k = 0; k < 3; ++k) {
    to.size[k][j] = from.size[k][i];
    to.piece[k][j] = from.piece[k][i];
  }
  to.error[j] = from.error[i];
  to.lo[j] = from.lo[i];
  to.hi[j] = from.hi[i];
  to.at_lo[j] = from.at_lo[i];
  to.at_hi[j] = from.at_hi[i];
  to.outcome[j] = from.outcome[i];
  to.pair[j] = from.pair[i];
  to.current[j] = from.current[i];
}

/// Writes out the settled pairs; moves those with another root to look for to the front, and those whose root was
/// not bracketed to `patient` (undecided where there is none).
inline void settle(RootBlock& roots, double cells, const BatchOutput& out, RootBlock* patient) {
  std::size_t rest = 0;
  for (std::size_t j = 0; j < roots.count; ++j) {
    if (roots.outcome[j] == ROOT_NO_CONTACT) selectPiece(roots, j, roots.current[j] + 1);
    if (roots.outcome[j] == ROOT_PENDING) {
      if (rest != j) copyLane(roots, j, roots, rest);
      ++rest;
      continue;
    }
    if (roots.outcome[j] == ROOT_NOT_BRACKETED) {
      roots.outcome[j] = ROOT_UNCERTAIN;
      if (patient != nullptr) {
        roots.outcome[j] = ROOT_PENDING;
        copyLane(roots, j, *patient, patient->count++);
        continue;
      }
    }
    const std::size_t pair = roots.pair[j];
    out.verdict[pair] = static_cast<std::uint8_t>(roots.outcome[j]);
    out.lo[pair] = roots.root_lo[j];
    out.hi[pair] = roots.root_hi[j];
    const bool contact = roots.outcome[j] == ROOT_CONTACT;
    out.cell[pair] = contact ? static_cast<std::uint64_t>(roots.root_lo[j] * cells) : 0;
  }
  roots.count = rest;
}

/// Third pass: refines one root after the other until every pair is settled. A pair's answer depends on its own lane
/// only, never on its neighbours.
template <bool CERTIFIED, BatchKind KIND>
HWY_INLINE void refineAll(RootBlock& roots, double cells, int steps, const BatchOutput& out, RootBlock* patient) {
  while (roots.count != 0) {
    for (std::size_t j = roots.count; j % hn::Lanes(Tag()) != 0; ++j) copyLane(roots, roots.count - 1, roots, j);
    for (std::size_t i = 0; i < roots.count; i += hn::Lanes(Tag())) refine<CERTIFIED, KIND>(roots, i, cells, steps);
    settle(roots, cells, out, patient);
  }
}

template <bool CERTIFIED, BatchKind KIND>
HWY_INLINE void runKind(const BatchInput& in, const BatchOutput& out) {
  const std::size_t lanes = hn::Lanes(Tag());
  const double cells = static_cast<double>(std::uint64_t{1} << in.toc_bits);
  MotionBlock block;
  RootBlock roots, patient;
  for (std::size_t first = 0; first < in.count; first += BATCH_BLOCK) {
    const std::size_t count = in.count - first < BATCH_BLOCK ? in.count - first : BATCH_BLOCK;
    gather<KIND>(in, first, count, block);
    reject<CERTIFIED>(block, first, count, out, roots);
    for (std::size_t i = 0; i < roots.count; i += lanes) classify<CERTIFIED>(roots, i);
    if (patient.count + roots.count > BATCH_BLOCK) {
      refineAll<CERTIFIED, KIND>(patient, cells, PATIENT_STEPS, out, nullptr);
    }
    refineAll<CERTIFIED, KIND>(roots, cells, QUICK_STEPS, out, &patient);
  }
  refineAll<CERTIFIED, KIND>(patient, cells, PATIENT_STEPS, out, nullptr);
}

template <bool CERTIFIED>
void runBatch(const BatchInput& in, const BatchOutput& out) {
  if (in.kind == BatchKind::VERTEX_FACE) {
    runKind<CERTIFIED, BatchKind::VERTEX_FACE>(in, out);
  } else {
    runKind<CERTIFIED, BatchKind::EDGE_EDGE>(in, out);
  }
}

void exactBatchOn(const BatchInput& in, const BatchOutput& out) { runBatch<true>(in, out); }
void fastBatchOn(const BatchInput& in, const BatchOutput& out) { runBatch<false>(in, out); }
const char* targetName() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace deformable_ccd
HWY_AFTER_NAMESPACE();
