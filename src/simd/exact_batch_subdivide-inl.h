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

/// Says what one vector of intervals holds: nothing, where certainly no root is or the features are apart, one root, or
/// perhaps more. Returns the lanes with one root.
template <BatchKind KIND>
HWY_INLINE unsigned lookAt(HardBlock& hard, std::size_t i) {
  const V third = constant(1.0 / 3), from = load(hard.from, i);
  const V f0 = load(hard.coefficient[0], i), f3 = load(hard.coefficient[3], i), error = load(hard.error, i);
  const V f1 = hn::Mul(load(hard.coefficient[1], i), third), f2 = hn::Mul(load(hard.coefficient[2], i), third);
  const V a = warp(from), b = warp(hn::Add(from, load(hard.width, i)));
  V c0, c1, c2, c3;
  overPiece(f0, f1, f2, f3, a, b, c0, c1, c2, c3);
  V piece = pieceOf<true, false>(c0, c1, c2, c3, error);
  if (!hn::AllTrue(Tag(), hn::Eq(piece, constant(PIECE_FREE)))) {
    piece = choose(apart<KIND>(hard, i, a, b), constant(PIECE_FREE), piece);
  }
  store(piece, hard.piece, i);
  store(a, hard.lo, i), store(b, hard.hi, i), store(c0, hard.at_lo, i);
  return bitsOf(hn::Eq(piece, constant(PIECE_ROOT)));
}

/// One vector of certified brackets that leave it open whether the features meet: no contact, a contact, uncertain in
/// every interval around it, or not bracketed closely enough.
template <BatchKind KIND>
HWY_INLINE void lookCloser(HardBlock& roots, std::size_t i, double cells) {
  const V lo = load(roots.root_lo, i), hi = load(roots.root_hi, i), unknown = constant(ROOT_UNCERTAIN);
  const M narrow = hn::Le(hn::Sub(hi, lo), constant(NARROW_BRACKET));
  V outcome = unknown;
  if (!hn::AllFalse(Tag(), narrow)) {
    settleDirected<KIND>(roots, i, cells);
    outcome = choose(narrow, load(roots.outcome, i), unknown);
  }
  const M open = hn::Eq(outcome, unknown);
  if (!hn::AllFalse(Tag(), open)) {
    const M free = hn::And(open, apart<KIND>(roots, i, lo, hi));
    outcome = choose(hn::AndNot(narrow, open), constant(ROOT_NOT_BRACKETED), outcome);
    outcome = choose(free, constant(ROOT_NO_CONTACT), outcome);
  }
  store(outcome, roots.outcome, i);
}

/// What settleDirected() and settleParallel() read besides what copyPair() copies.
inline void copyRest(const HardBlock& from, std::size_t i, HardBlock& to, std::size_t j) {
  for (int k = 0; k < MOTION_PLANES; ++k) to.rest.motion[k][j] = from.rest.motion[k][i];
}

/// Tells a pair what became of the root in its interval.
HWY_INLINE void tell(const HardBlock& roots, std::size_t j, HardBlock& hard) {
  const std::size_t lane = roots.pair[j];
  const double outcome = roots.outcome[j];
  if (outcome == ROOT_NO_CONTACT) hard.piece[lane] = PIECE_FREE;
  if (outcome == ROOT_NO_CONTACT || outcome == ROOT_NOT_BRACKETED) return;
  hard.outcome[lane] = outcome;
  if (outcome == ROOT_UNCERTAIN) return;
  hard.root_lo[lane] = roots.root_lo[j];
  hard.root_hi[lane] = roots.root_hi[j];
}

/// Refines the roots of those intervals that have one. `pair` of a root is the lane of `hard` that it comes from.
template <BatchKind KIND>
HWY_INLINE void refineRoots(HardBlock& roots, HardBlock& hard, double cells) {
  fillUp(roots);
  refine<true, KIND, false, PATIENT_STEPS>(roots, cells);
  std::size_t open = 0;
  for (std::size_t j = 0; j < roots.count; ++j) {
    if (roots.outcome[j] != ROOT_UNCERTAIN) {
      tell(roots, j, hard);
      continue;
    }
    if (open != j) copyPair(roots, j, roots, open);
    copyRest(hard, roots.pair[j], roots, open);
    roots.root_lo[open] = roots.root_lo[j], roots.root_hi[open] = roots.root_hi[j];
    roots.outcome[open++] = ROOT_UNCERTAIN;
  }
  roots.count = open;
  fillUp(roots);
  for (std::size_t i = 0; i < roots.count; i += lanes()) lookCloser<KIND>(roots, i, cells);
  for (std::size_t j = 0; j < roots.count; ++j) tell(roots, j, hard);
  roots.count = 0;
}

/// Goes on one vector of pairs to the next interval, of a free one, or to the left half.
HWY_INLINE void advance(HardBlock& hard, std::size_t i, bool is_last) {
  const V one = constant(1), from = load(hard.from, i), width = load(hard.width, i), pending = constant(ROOT_PENDING);
  const M free = hn::Eq(load(hard.piece, i), constant(PIECE_FREE));
  V result = load(hard.outcome, i);
  const V next = hn::Add(from, width), wider = hn::Add(width, width);
  const M ascend = hn::And(hn::Eq(hn::Mul(floorOf(hn::Div(next, wider)), wider), next), hn::Lt(next, one));
  const M done = hn::And(hn::Eq(result, pending), hn::And(free, hn::Ge(next, one)));
  result = choose(done, constant(ROOT_NO_CONTACT), result);
  const V then = choose(free, choose(ascend, wider, width), hn::Mul(constant(0.5), width));
  const M given_up = is_last ? hn::FirstN(Tag(), lanes()) : hn::Lt(then, load(hard.smallest, i));
  result = choose(hn::And(hn::Eq(result, pending), given_up), constant(ROOT_UNCERTAIN), result);
  store(choose(free, next, from), hard.from, i);
  store(then, hard.width, i);
  store(result, hard.outcome, i);
}

/// Writes out what is settled, and moves the others together. Of edges `parallel` gets those that are uncertain.
template <BatchKind KIND>
HWY_INLINE void takeOut(HardBlock& hard, HardBlock& parallel, double cells, const BatchOutput& out) {
  std::size_t pending = 0;
  for (std::size_t i = 0; i < hard.count; i += lanes()) {
    const unsigned all = pairsOf(hard, i);
    const unsigned waiting = all & bitsOf(hn::Eq(load(hard.outcome, i), constant(ROOT_PENDING)));
    for (unsigned bits = all & ~waiting; bits != 0; bits &= bits - 1) {
      const std::size_t j = i + hwy::Num0BitsBelowLS1Bit_Nonzero32(bits);
      if (KIND == BatchKind::VERTEX_FACE || hard.outcome[j] != ROOT_UNCERTAIN) {
        writeOut(hard, j, cells, out);
        continue;
      }
      copyPair(hard, j, parallel, parallel.count);
      copyRest(hard, j, parallel, parallel.count);
      parallel.root_lo[parallel.count] = parallel.root_hi[parallel.count] = 0;
      parallel.outcome[parallel.count++] = ROOT_UNCERTAIN;
    }
    moveTogether(hard, i, waiting, pending);
  }
  hard.count = pending;
  fillUp(hard);
  fillUp(parallel);
  for (std::size_t i = 0; i < parallel.count; i += lanes()) settleParallel(parallel, i);
  for (std::size_t j = 0; j < parallel.count; ++j) writeOut(parallel, j, cells, out);
  parallel.count = 0;
}

/// Intervals from left to right: each is proved free, or holds one root, which is refined, or is halved. A pair is
/// settled by its first certain contact. All pairs look at one interval in turn; roots are refined side by side.
template <BatchKind KIND>
void subdivideAll(HardBlock& hard, double cells, const BatchOutput& out) {
  if (hard.count == 0) return;
  HardBlock roots;
  for (std::size_t j = hard.count; j % lanes() != 0; ++j) copyPair(hard, hard.count - 1, hard, j);
  sharpen<KIND>(hard);
  const V zero = hn::Zero(Tag());
  for (std::size_t i = 0; i < hard.count; i += lanes()) {
    store(zero, hard.from, i), store(constant(1), hard.width, i), store(smallestInterval(hard, i), hard.smallest, i);
    store(constant(ROOT_PENDING), hard.outcome, i), store(zero, hard.root_lo, i), store(zero, hard.root_hi, i);
  }
  for (int k = 1; hard.count != 0; ++k) {
    for (std::size_t i = 0; i < hard.count; i += lanes()) {
      for (unsigned bits = lookAt<KIND>(hard, i); bits != 0; bits &= bits - 1) {
        const std::size_t j = i + hwy::Num0BitsBelowLS1Bit_Nonzero32(bits);
        if (j >= hard.count) break;
        copyPair(hard, j, roots, roots.count);
        roots.lo[roots.count] = hard.lo[j], roots.hi[roots.count] = hard.hi[j],
        roots.at_lo[roots.count] = hard.at_lo[j];
        roots.outcome[roots.count] = ROOT_PENDING;
        roots.pair[roots.count++] = static_cast<std::uint32_t>(j);
      }
    }
    if (roots.count != 0) refineRoots<KIND>(roots, hard, cells);
    for (std::size_t i = 0; i < hard.count; i += lanes()) advance(hard, i, k == MAX_INTERVALS);
    takeOut<KIND>(hard, roots, cells, out);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();
