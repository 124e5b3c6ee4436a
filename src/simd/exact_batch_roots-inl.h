// Second stage of the batched elementary test: see exact_batch-inl.h, which includes this.
HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {

/// Two places that split [0,1] into pieces on which the Bernstein coefficients of f are monotone: the extrema of f, or
/// its inflection point where it has none. f1 and f2 are three times the coefficients, as RootBlock keeps them. Any
/// place is safe; these leave no piece uncertain without need.
HWY_INLINE void splits(V f0, V f1, V f2, V f3, V& first, V& second) {
  const V zero = hn::Zero(Tag()), one = constant(1), three = constant(3);
  const V a1 = hn::Sub(f1, hn::Mul(three, f0));
  const V a2 = hn::Add(hn::Sub(hn::Mul(three, f0), hn::Add(f1, f1)), f2);
  const V a3 = hn::Mul(three, hn::Add(hn::Sub(f3, f2), hn::Sub(f1, f0)));
  const V discriminant = hn::Sub(hn::Mul(a2, a2), hn::Mul(a3, a1));
  const V root = hn::Sqrt(choose(hn::Gt(discriminant, zero), discriminant, zero));
  const V q = hn::Neg(choose(hn::Lt(a2, zero), hn::Sub(a2, root), hn::Add(a2, root)));
  const V p1 = hn::Div(q, a3), p2 = hn::Div(a1, q);
  // Outside (0,1), NaN included: the end 0, which makes an empty piece.
  const V t1 = choose(hn::And(hn::Gt(p1, zero), hn::Lt(p1, one)), onGrid(p1), zero);
  const V t2 = choose(hn::And(hn::Gt(p2, zero), hn::Lt(p2, one)), onGrid(p2), zero);
  const M swap = hn::Gt(t1, t2);
  first = choose(swap, t2, t1);
  second = choose(swap, t1, t2);
}

/// Bernstein coefficients of f over [a, b] by de Casteljau's algorithm, from f0, f1, f2, f3 (not three times f1, f2).
HWY_INLINE void overPiece(V f0, V f1, V f2, V f3, V a, V b, V& c0, V& c1, V& c2, V& c3) {
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

/// What is certain of a piece with these coefficients. With BY_ENDS only the ends are looked at: pieces on which f is
/// monotone up to rounding, where nothing is to be proved.
template <bool CERTIFIED, bool BY_ENDS>
HWY_INLINE V pieceOf(V c0, V c1, V c2, V c3, V error) {
  const M p0 = isPositive<CERTIFIED>(c0, error), n0 = isNegative<CERTIFIED>(c0, error);
  const M p3 = isPositive<CERTIFIED>(c3, error), n3 = isNegative<CERTIFIED>(c3, error);
  if (BY_ENDS) {
    return choose(hn::Or(hn::And(p0, n3), hn::And(n0, p3)), constant(PIECE_ROOT), constant(PIECE_FREE));
  }
  const M plus = hn::And(isPositive<CERTIFIED>(c1, error), isPositive<CERTIFIED>(c2, error));
  const M minus = hn::And(isNegative<CERTIFIED>(c1, error), isNegative<CERTIFIED>(c2, error));
  const M free = hn::Or(hn::And(hn::And(p0, p3), plus), hn::And(hn::And(n0, n3), minus));
  const M one_root = hasOneRoot<CERTIFIED>(c0, c1, c2, c3, error, error);
  return choose(one_root, constant(PIECE_ROOT), choose(free, constant(PIECE_FREE), constant(PIECE_UNCERTAIN)));
}

/// Copies one lane, except what the search for its next root sets.
inline void copyPair(const RootBlock& from, std::size_t i, RootBlock& to, std::size_t j) {
  for (int k = 0; k < MOTION_PLANES; ++k) to.motion[k][j] = from.motion[k][i];
  for (int k = 0; k < 4; ++k) to.coefficient[k][j] = from.coefficient[k][i];
  for (int k = 0; k < 3; ++k) to.size[k][j] = from.size[k][i];
  to.error[j] = from.error[i];
  to.pair[j] = from.pair[i];
}

/// Calls act() on every plane of a block except those that the search for its next root sets.
template <class Do>
HWY_INLINE void onPlanes(RootBlock& roots, const Do& act) {
  for (int k = 0; k < MOTION_PLANES; ++k) act(roots.motion[k]);
  for (int k = 0; k < 4; ++k) act(roots.coefficient[k]);
  for (int k = 0; k < 3; ++k) act(roots.size[k]);
  act(roots.error);
}
template <class Do>
HWY_INLINE void onPlanes(SplitBlock& roots, const Do& act) {
  onPlanes(static_cast<RootBlock&>(roots), act);
  for (int k = 0; k < 4; ++k) act(roots.end[k]);
  for (int k = 0; k < 3; ++k) act(roots.value[k]);
  for (int k = 0; k < 3; ++k) act(roots.piece[k]);
  act(roots.lo);
  act(roots.hi);
  act(roots.at_lo);
  act(roots.outcome);
  act(roots.current);
}

template <class Do>
HWY_INLINE void onPlanes(HardBlock& pairs, const Do& act) {
  onPlanes(static_cast<RootBlock&>(pairs), act);
  for (int k = 0; k < MOTION_PLANES; ++k) act(pairs.rest.motion[k]);
  for (double* plane : {pairs.from, pairs.width, pairs.smallest, pairs.lo, pairs.hi, pairs.at_lo}) act(plane);
  for (double* plane : {pairs.outcome, pairs.root_lo, pairs.root_hi}) act(plane);
}

/// Copies of the last pair up to a whole vector.
struct FillUp {
  std::size_t count;
  HWY_INLINE void operator()(double* plane) const { hn::StoreU(constant(plane[count - 1]), Tag(), plane + count); }
};
template <class Block>
HWY_INLINE void fillUp(Block& roots) {
  if (roots.count % lanes() != 0) onPlanes(roots, FillUp{roots.count});
}

/// Moves the lanes of the vector at `from` that `front` lists to `to` <= `from`. A whole vector is written, which ends
/// no later than the one that was read.
struct MoveTogether {
  decltype(hn::SetTableIndices(Tag(), FRONT_TABLE.row[0])) front;
  std::size_t from, to;
  HWY_INLINE void operator()(double* plane) const {
    hn::StoreU(hn::TableLookupLanes(load(plane, from), front), Tag(), plane + to);
  }
};

/// The lanes of the vector at i that are pairs, not copies of the last one.
HWY_INLINE unsigned pairsOf(const RootBlock& roots, std::size_t i) {
  return roots.count - i < lanes() ? (1u << (roots.count - i)) - 1 : (1u << lanes()) - 1;
}

/// Appends these lanes of the vector at i to the `count` that were moved before.
template <class Block>
HWY_INLINE void moveTogether(Block& roots, std::size_t i, unsigned which, std::size_t& count) {
  if (which == 0) return;
  onPlanes(roots, MoveTogether{hn::SetTableIndices(Tag(), FRONT_TABLE.row[which]), i, count});
  for (unsigned bits = which; bits != 0; bits &= bits - 1) {
    roots.pair[count++] = roots.pair[i + hwy::Num0BitsBelowLS1Bit_Nonzero32(bits)];
  }
}

/// Every pair's root_lo is in [0,1], so that the conversion is defined: of a pair without a root it is 0 or another's.
HWY_INLINE void writeOut(const RootBlock& roots, std::size_t j, double cells, const BatchOutput& out) {
  const std::size_t pair = roots.pair[j];
  out.verdict[pair] = static_cast<std::uint8_t>(roots.outcome[j]);
  out.lo[pair] = roots.root_lo[j];
  out.hi[pair] = roots.root_hi[j];
  out.cell[pair] = static_cast<std::uint64_t>(roots.root_lo[j] * cells);
}

/// Leaves a pair to subdivision, which starts afresh; solves what is there when the block is full.
template <BatchKind KIND>
void subdivideAll(HardBlock& hard, double cells, const BatchOutput& out);
template <BatchKind KIND>
HWY_INLINE void leave(const RootBlock& roots, std::size_t j, double cells, HardBlock& hard, const BatchOutput& out) {
  copyPair(roots, j, hard, hard.count++);
  if (hard.count == BATCH_BLOCK) subdivideAll<KIND>(hard, cells, out);
}

/// Pairs with certainly one root in the step that fewer steps did not bracket.
template <BatchKind KIND, int STEPS>
HWY_NOINLINE void solveStubborn(RootBlock& roots, double cells, HardBlock& hard, const BatchOutput& out);

/// Pairs with certainly one root in the step: with a few Halley steps, and more for those that these did not bring
/// close.
template <bool CERTIFIED, BatchKind KIND, int STEPS = QUICK_STEPS>
HWY_INLINE void solveSingle(RootBlock& roots, double cells, HardBlock& hard, const BatchOutput& out) {
  constexpr int NEXT_STEPS = STEPS < MORE_STEPS ? MORE_STEPS : PATIENT_STEPS;
  fillUp(roots);
  refine<CERTIFIED, KIND, true, STEPS>(roots, cells);
  std::size_t again = 0;
  for (std::size_t j = 0; j < roots.count; ++j) {
    if (CERTIFIED && STEPS < PATIENT_STEPS && roots.outcome[j] == ROOT_NOT_BRACKETED) {
      if (again != j) copyPair(roots, j, roots, again);
      ++again;
    } else if (CERTIFIED && (roots.outcome[j] == ROOT_UNCERTAIN || roots.outcome[j] == ROOT_NOT_BRACKETED)) {
      leave<KIND>(roots, j, cells, hard, out);
    } else {
      writeOut(roots, j, cells, out);
    }
  }
  roots.count = again;
  if constexpr (STEPS < PATIENT_STEPS) {
    if (again != 0) solveStubborn<KIND, NEXT_STEPS>(roots, cells, hard, out);
  }
  roots.count = 0;
}

template <BatchKind KIND, int STEPS>
void solveStubborn(RootBlock& roots, double cells, HardBlock& hard, const BatchOutput& out) {
  solveSingle<true, KIND, STEPS>(roots, cells, hard, out);
}

/// Where the last root was no contact, makes the next piece that is not free the current one, or settles the pair.
HWY_INLINE void selectPiece(SplitBlock& roots, std::size_t i) {
  const V previous = load(roots.outcome, i), last = load(roots.current, i);
  V current = constant(3), outcome = constant(ROOT_NO_CONTACT);
  V lo = hn::Zero(Tag()), hi = lo, at_lo = lo;
  for (int k = 2; k >= 0; --k) {
    const V piece = load(roots.piece[k], i);
    const M next = hn::And(hn::Gt(constant(k), last), hn::Gt(piece, constant(PIECE_FREE)));
    const M root = hn::Eq(piece, constant(PIECE_ROOT));
    current = choose(next, constant(k), current);
    outcome = choose(next, choose(root, constant(ROOT_PENDING), constant(ROOT_UNCERTAIN)), outcome);
    lo = choose(next, load(roots.end[k], i), lo);
    hi = choose(next, load(roots.end[k + 1], i), hi);
    at_lo = choose(next, load(roots.value[k], i), at_lo);
  }
  store(choose(hn::Eq(previous, constant(ROOT_NO_CONTACT)), outcome, previous), roots.outcome, i);
  store(current, roots.current, i);
  store(lo, roots.lo, i);
  store(hi, roots.hi, i);
  store(at_lo, roots.at_lo, i);
}

/// Splits the step of one vector of pairs at the extrema of f, and says what each piece holds.
template <bool CERTIFIED>
HWY_INLINE void split(SplitBlock& roots, std::size_t i) {
  const V third = constant(1.0 / 3);
  const V f0 = load(roots.coefficient[0], i), f3 = load(roots.coefficient[3], i);
  const V f1_times_3 = load(roots.coefficient[1], i), f2_times_3 = load(roots.coefficient[2], i);
  const V f1 = hn::Mul(f1_times_3, third), f2 = hn::Mul(f2_times_3, third);
  const V error = CERTIFIED ? load(roots.error, i) : hn::Zero(Tag());
  V t1, t2;
  splits(f0, f1_times_3, f2_times_3, f3, t1, t2);
  store(hn::Zero(Tag()), roots.end[0], i);
  store(t1, roots.end[1], i);
  store(t2, roots.end[2], i);
  store(constant(1), roots.end[3], i);
  for (int k = 0; k < 3; ++k) {
    V c0, c1, c2, c3;
    overPiece(f0, f1, f2, f3, load(roots.end[k], i), load(roots.end[k + 1], i), c0, c1, c2, c3);
    store(pieceOf<CERTIFIED, !CERTIFIED>(c0, c1, c2, c3, error), roots.piece[k], i);
    store(c0, roots.value[k], i);
  }
  store(constant(-1), roots.current, i);
  store(constant(ROOT_NO_CONTACT), roots.outcome, i);
  store(hn::Zero(Tag()), roots.root_lo, i);
  store(hn::Zero(Tag()), roots.root_hi, i);
}

/// Pairs with perhaps several roots: one after the other, until one is a contact or none is left.
template <bool CERTIFIED, BatchKind KIND>
HWY_INLINE void solveSeveral(SplitBlock& roots, double cells, HardBlock& hard, const BatchOutput& out) {
  if (roots.count == 0) return;
  fillUp(roots);
  for (std::size_t i = 0; i < roots.count; i += lanes()) split<CERTIFIED>(roots, i);
  while (roots.count != 0) {
    std::size_t pending = 0;
    for (std::size_t i = 0; i < roots.count; i += lanes()) {
      selectPiece(roots, i);
      const V outcome = load(roots.outcome, i);
      const unsigned all = pairsOf(roots, i);
      const unsigned waiting = all & bitsOf(hn::Eq(outcome, constant(ROOT_PENDING)));
      const M left = hn::Or(hn::Eq(outcome, constant(ROOT_UNCERTAIN)), hn::Eq(outcome, constant(ROOT_NOT_BRACKETED)));
      const unsigned uncertain = CERTIFIED ? all & bitsOf(left) : 0;
      for (unsigned bits = uncertain; bits != 0; bits &= bits - 1) {
        leave<KIND>(roots, i + hwy::Num0BitsBelowLS1Bit_Nonzero32(bits), cells, hard, out);
      }
      for (unsigned bits = all & ~waiting & ~uncertain; bits != 0; bits &= bits - 1) {
        writeOut(roots, i + hwy::Num0BitsBelowLS1Bit_Nonzero32(bits), cells, out);
      }
      moveTogether(roots, i, waiting, pending);
    }
    roots.count = pending;
    fillUp(roots);
    refine<CERTIFIED, KIND, false, SPLIT_STEPS>(roots, cells);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();
