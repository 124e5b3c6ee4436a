// Third stage of the batched elementary test: see exact_batch-inl.h, which includes this.
HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {

constexpr int MAX_INTERVALS = 48;  ///< looked at per pair
constexpr double SMALLEST_INTERVAL = tolerance::BATCH_SMALLEST_INTERVAL;
constexpr double SMALLEST_INTERVAL_AT_ENDS = tolerance::BATCH_SMALLEST_INTERVAL_AT_ENDS;
constexpr double NARROW_BRACKET = tolerance::BATCH_NARROW_BRACKET;

/// Interval ends: x in [0,1] to t in [0,1], monotone, but not dyadic, because hand-made inputs meet at 1/2 and 1/4,
/// where f would stay uncertain at every level.
HWY_INLINE V warp(V x) { return onGrid(hn::Add(x, hn::Mul(constant(0.1376), hn::Mul(x, hn::Sub(constant(1), x))))); }

/// Adds to `plus` and `minus` the lanes whose quadratic with Bernstein coefficients q0, q1_times_2 / 2, q2 certainly
/// keeps that sign over the interval.
HWY_INLINE void keepsSign(V q0, V q1_times_2, V q2, V error, M& plus, M& minus) {
  const V twice = hn::Add(error, error), against = hn::Neg(error), twice_against = hn::Neg(twice);
  plus = hn::Or(plus, hn::And(hn::And(hn::Gt(q0, error), hn::Gt(q2, error)), hn::Gt(q1_times_2, twice)));
  minus = hn::Or(minus, hn::And(hn::And(hn::Lt(q0, against), hn::Lt(q2, against)), hn::Lt(q1_times_2, twice_against)));
}

/// Lanes whose features are certainly apart at every t of an interval, whatever f does: in the projection along one
/// axis, with n, B, C as in insideTest(), a contact makes all of n, B, C, n-B-C (VF), or n, B, C, n-B, n-C (EE),
/// zero or of one sign; so one that is positive and one that is negative throughout exclude it. Holds for parallel
/// edges and flat triangles too: B = s n and the like need no division. a, b: the vectors at the interval's ends.
template <BatchKind KIND>
HWY_INLINE M apartAlong(V ua1, V ua2, V va1, V va2, V wa1, V wa2, V ub1, V ub2, V vb1, V vb2, V wb1, V wb2, V error_n,
                        V error_b, V error_c) {
  constexpr bool VF = KIND == BatchKind::VERTEX_FACE;
  const V n0 = minor(ua1, va2, ua2, va1), n2 = minor(ub1, vb2, ub2, vb1);
  const V n1 = hn::Add(minor(ua1, vb2, ua2, vb1), minor(ub1, va2, ub2, va1));
  const V b0 = minor(wa1, va2, wa2, va1), b2 = minor(wb1, vb2, wb2, vb1);
  const V b1 = hn::Add(minor(wa1, vb2, wa2, vb1), minor(wb1, va2, wb2, va1));
  V c0 = minor(wa1, ua2, wa2, ua1), c2 = minor(wb1, ub2, wb2, ub1);
  V c1 = hn::Add(minor(wa1, ub2, wa2, ub1), minor(wb1, ua2, wb2, ua1));
  if (VF) c0 = hn::Neg(c0), c1 = hn::Neg(c1), c2 = hn::Neg(c2);
  M plus = hn::FirstN(Tag(), 0), minus = plus;
  keepsSign(n0, n1, n2, error_n, plus, minus);
  keepsSign(b0, b1, b2, error_b, plus, minus);
  keepsSign(c0, c1, c2, error_c, plus, minus);
  if (VF) {
    keepsSign(hn::Sub(hn::Sub(n0, b0), c0), hn::Sub(hn::Sub(n1, b1), c1), hn::Sub(hn::Sub(n2, b2), c2),
              hn::Add(hn::Add(error_n, error_b), error_c), plus, minus);
  } else {
    keepsSign(hn::Sub(n0, b0), hn::Sub(n1, b1), hn::Sub(n2, b2), hn::Add(error_n, error_b), plus, minus);
    keepsSign(hn::Sub(n0, c0), hn::Sub(n1, c1), hn::Sub(n2, c2), hn::Add(error_n, error_c), plus, minus);
  }
  return hn::And(plus, minus);
}

/// Whether the features are certainly apart on one axis at both ends of an interval, in the same order: their places on
/// it are linear in t. What lies on one line at a time tells no more than this.
template <BatchKind KIND>
HWY_INLINE M apartOnAxis(V ua, V va, V wa, V ub, V vb, V wb, V error) {
  constexpr bool VF = KIND == BatchKind::VERTEX_FACE;
  const V zero = hn::Zero(Tag());
  const auto gaps = [&](V u, V v, V w, V& above, V& below) HWY_ATTR {
    if (VF) {
      above = hn::Sub(w, hn::Max(zero, hn::Max(u, v)));
      below = hn::Sub(hn::Min(zero, hn::Min(u, v)), w);
    } else {
      above = hn::Sub(hn::Add(w, hn::Min(zero, v)), hn::Max(zero, u));
      below = hn::Sub(hn::Min(zero, u), hn::Add(w, hn::Max(zero, v)));
    }
  };
  V above_a, below_a, above_b, below_b;
  gaps(ua, va, wa, above_a, below_a);
  gaps(ub, vb, wb, above_b, below_b);
  return hn::Or(hn::Gt(hn::Min(above_a, above_b), error), hn::Gt(hn::Min(below_a, below_b), error));
}

/// The same in the projection along each axis, and on it.
template <BatchKind KIND>
HWY_INLINE M apart(const RootBlock& pairs, std::size_t i, V a, V b) {
  const auto& m = pairs.motion;
  const V sa = hn::Sub(constant(1), a), sb = hn::Sub(constant(1), b);
  const V size_u = load(pairs.size[0], i), size_v = load(pairs.size[1], i), size_w = load(pairs.size[2], i);
  const V relative = constant(BATCH_SEPARATION);
  const V error_n = hn::Mul(hn::Mul(size_u, size_v), relative);
  const V error_b = hn::Mul(hn::Mul(size_v, size_w), relative);
  const V error_c = hn::Mul(hn::Mul(size_u, size_w), relative);
  const V error = hn::Mul(hn::Add(hn::Add(size_u, size_v), size_w), relative);
  V ua[3], va[3], wa[3], ub[3], vb[3], wb[3];
  for (int k = 0; k < 3; ++k) {
    const V u0 = load(m[U_T0 + k], i), u1 = load(m[U_T1 + k], i), v0 = load(m[V_T0 + k], i);
    const V v1 = load(m[V_T1 + k], i), w0 = load(m[W_T0 + k], i), w1 = load(m[W_T1 + k], i);
    ua[k] = lerp(u0, u1, sa, a), va[k] = lerp(v0, v1, sa, a), wa[k] = lerp(w0, w1, sa, a);
    ub[k] = lerp(u0, u1, sb, b), vb[k] = lerp(v0, v1, sb, b), wb[k] = lerp(w0, w1, sb, b);
  }
  M result = hn::FirstN(Tag(), 0);
  for (int axis = 0; axis < 3; ++axis) {
    const int p = axis == 2 ? 0 : axis + 1, q = axis == 0 ? 2 : axis - 1;
    const M along = apartAlong<KIND>(ua[p], ua[q], va[p], va[q], wa[p], wa[q], ub[p], ub[q], vb[p], vb[q], wb[p], wb[q],
                                     error_n, error_b, error_c);
    const M on = apartOnAxis<KIND>(ua[axis], va[axis], wa[axis], ub[axis], vb[axis], wb[axis], error);
    result = hn::Or(result, hn::Or(along, on));
  }
  return result;
}

/// Where subdivision ends. An interval at an end of the step at which f is uncertain can only be free because the
/// features are apart there, which wide intervals show as well; where it is uncertain at both ends, wider ones. For
/// features at rest all intervals are alike.
HWY_INLINE V smallestInterval(const RootBlock& pairs, std::size_t i) {
  const V f0 = load(pairs.coefficient[0], i), f3 = load(pairs.coefficient[3], i), error = load(pairs.error, i);
  M rests = hn::FirstN(Tag(), lanes());
  for (int k = 0; k < 3; ++k) {
    rests = hn::And(rests, hn::Eq(load(pairs.motion[U_T0 + k], i), load(pairs.motion[U_T1 + k], i)));
    rests = hn::And(rests, hn::Eq(load(pairs.motion[V_T0 + k], i), load(pairs.motion[V_T1 + k], i)));
    rests = hn::And(rests, hn::Eq(load(pairs.motion[W_T0 + k], i), load(pairs.motion[W_T1 + k], i)));
  }
  const M at_start = hn::Le(hn::Abs(f0), error), at_end = hn::Le(hn::Abs(f3), error);
  const V one_end = choose(hn::Or(at_start, at_end), constant(SMALLEST_INTERVAL_AT_ENDS * SMALLEST_INTERVAL_AT_ENDS),
                           constant(SMALLEST_INTERVAL));
  return choose(rests, constant(1), choose(hn::And(at_start, at_end), constant(SMALLEST_INTERVAL_AT_ENDS), one_end));
}

/// One vector, intervals from left to right: each is proved free (no root, or the features apart), or holds one root,
/// which is refined, or is halved. Stops at the first certain contact.
template <BatchKind KIND>
HWY_INLINE void subdivideVector(HardBlock& pairs, std::size_t i, double cells) {
  const Tag d;
  const V one = constant(1), zero = hn::Zero(d), third = constant(1.0 / 3), half = constant(0.5);
  const V f0 = load(pairs.coefficient[0], i), f3 = load(pairs.coefficient[3], i), error = load(pairs.error, i);
  const V f1 = hn::Mul(load(pairs.coefficient[1], i), third), f2 = hn::Mul(load(pairs.coefficient[2], i), third);
  const V smallest = smallestInterval(pairs, i);
  V from = zero, width = one, result = constant(ROOT_PENDING), kept_lo = zero, kept_hi = zero;
  for (int k = 0; k < MAX_INTERVALS; ++k) {
    const M active = hn::Eq(result, constant(ROOT_PENDING));
    if (hn::AllFalse(d, active)) break;
    const V a = warp(from), b = warp(hn::Add(from, width));
    V c0, c1, c2, c3;
    overPiece(f0, f1, f2, f3, a, b, c0, c1, c2, c3);
    const V piece = pieceOf<true, false>(c0, c1, c2, c3, error);
    M free = hn::Eq(piece, constant(PIECE_FREE));
    if (!hn::AllTrue(d, hn::Or(free, hn::Not(active)))) free = hn::Or(free, apart<KIND>(pairs, i, a, b));
    const M has_root = hn::And(active, hn::AndNot(free, hn::Eq(piece, constant(PIECE_ROOT))));
    if (!hn::AllFalse(d, has_root)) {
      store(a, pairs.lo, i), store(b, pairs.hi, i), store(c0, pairs.at_lo, i);
      store(choose(has_root, constant(ROOT_PENDING), constant(ROOT_UNCERTAIN)), pairs.outcome, i);
      approximate<false, PATIENT_STEPS>(pairs, i);
      certify<true, KIND, false, PATIENT_STEPS>(pairs, i, cells);
      const V lo = load(pairs.root_lo, i), hi = load(pairs.root_hi, i);
      const M narrow = hn::Le(hn::Sub(hi, lo), constant(NARROW_BRACKET));
      V outcome = load(pairs.outcome, i);
      const M open = hn::And(hn::And(has_root, narrow), hn::Eq(outcome, constant(ROOT_UNCERTAIN)));
      if (!hn::AllFalse(d, open)) {
        settleDirected<KIND>(pairs, i, cells);
        outcome = choose(open, load(pairs.outcome, i), outcome);
      }
      const M contact =
          hn::Or(hn::Eq(outcome, constant(ROOT_CONTACT)), hn::Eq(outcome, constant(ROOT_CONTACT_NO_CELL)));
      free = hn::Or(free, hn::Eq(outcome, constant(ROOT_NO_CONTACT)));
      result = choose(contact, outcome, result);
      const M uncertain = hn::And(has_root, hn::Eq(outcome, constant(ROOT_UNCERTAIN)));
      if (!hn::AllFalse(d, uncertain)) free = hn::Or(free, hn::And(uncertain, apart<KIND>(pairs, i, lo, hi)));
      // What stays uncertain in a narrow bracket stays so in every interval around it.
      const M stuck = hn::And(hn::AndNot(free, uncertain), narrow);
      result = choose(stuck, constant(ROOT_UNCERTAIN), result);
      kept_lo = choose(contact, load(pairs.root_lo, i), kept_lo);
      kept_hi = choose(contact, load(pairs.root_hi, i), kept_hi);
    }
    const V next = hn::Add(from, width), wider = hn::Add(width, width);
    const M ascend = hn::And(hn::Eq(hn::Mul(floorOf(hn::Div(next, wider)), wider), next), hn::Lt(next, one));
    const M still = hn::Eq(result, constant(ROOT_PENDING));
    result = choose(hn::And(still, hn::And(free, hn::Ge(next, one))), constant(ROOT_NO_CONTACT), result);
    from = choose(free, next, from);
    width = choose(free, choose(ascend, wider, width), hn::Mul(half, width));
    result = choose(hn::And(hn::Eq(result, constant(ROOT_PENDING)), hn::Lt(width, smallest)), constant(ROOT_UNCERTAIN),
                    result);
  }
  result = choose(hn::Eq(result, constant(ROOT_PENDING)), constant(ROOT_UNCERTAIN), result);
  store(result, pairs.outcome, i);
  const bool edges = KIND == BatchKind::EDGE_EDGE;
  if (edges && !hn::AllFalse(d, hn::Eq(result, constant(ROOT_UNCERTAIN)))) settleParallel(pairs, i);
  store(kept_lo, pairs.root_lo, i);
  store(kept_hi, pairs.root_hi, i);
}

template <BatchKind KIND>
void subdivideAll(HardBlock& hard, double cells, const BatchOutput& out) {
  for (std::size_t j = hard.count; j % lanes() != 0; ++j) copyPair(hard, hard.count - 1, hard, j);
  sharpen<KIND>(hard);
  for (std::size_t i = 0; i < hard.count; i += lanes()) subdivideVector<KIND>(hard, i, cells);
  for (std::size_t j = 0; j < hard.count; ++j) writeOut(hard, j, cells, out);
  hard.count = 0;
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();
