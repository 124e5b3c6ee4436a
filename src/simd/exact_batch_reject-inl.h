// First stage of the batched elementary test: see exact_batch-inl.h, which includes this.
HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {

/// Which vertices of a quad the differences u, v, w are of: the first less the second.
template <BatchKind KIND>
constexpr int ENDS[3][2] = {{1, 0}, {3, 2}, {2, 0}};
template <>
constexpr int ENDS<BatchKind::VERTEX_FACE>[3][2] = {{2, 1}, {3, 1}, {0, 1}};

HWY_INLINE void prefetchPair(const BatchInput& in, std::size_t pair) {
  if (pair >= in.count) return;
  for (int i = 0; i < 4; ++i) hwy::Prefetch(in.vertices + std::size_t{8} * in.quads[pair][i]);
}
constexpr std::size_t PAIRS_AHEAD = 16;  ///< so far ahead vertices are fetched from memory

struct RoundedDifference {
  HWY_INLINE V operator()(V to, V from) const { return hn::Sub(to, from); }
  double operator()(double to, double from) const { return to - from; }
};

#if DCCD_AVX512
/// Columns 0, 1, 2 and 4, 5, 6 of eight rows, to planes from `to` and from `to_t1` on.
HWY_INLINE void storeColumns(const V (&rows)[8], std::size_t at, BatchPlane* to, BatchPlane* to_t1) {
  const Tag d;
  V even[4], odd[4];  // of two rows each: columns 0, 2, 4, 6 and 1, 3, 5, 7, a block of 128 bits a column
  for (int i = 0; i < 4; ++i) {
    even[i] = hn::InterleaveLower(d, rows[2 * i], rows[2 * i + 1]);
    odd[i] = hn::InterleaveUpper(d, rows[2 * i], rows[2 * i + 1]);
  }
  const auto firsts = [](V one, V other) HWY_ATTR { return hn::OddEvenBlocks(hn::SwapAdjacentBlocks(other), one); };
  const auto seconds = [](V one, V other) HWY_ATTR { return hn::OddEvenBlocks(other, hn::SwapAdjacentBlocks(one)); };
  const V even_04 = firsts(even[0], even[1]), later_even_04 = firsts(even[2], even[3]);
  const V even_26 = seconds(even[0], even[1]), later_even_26 = seconds(even[2], even[3]);
  const V odd_15 = firsts(odd[0], odd[1]), later_odd_15 = firsts(odd[2], odd[3]);
  store(hn::ConcatLowerLower(d, later_even_04, even_04), to[0], at);
  store(hn::ConcatLowerLower(d, later_odd_15, odd_15), to[1], at);
  store(hn::ConcatLowerLower(d, later_even_26, even_26), to[2], at);
  store(hn::ConcatUpperUpper(d, later_even_04, even_04), to_t1[0], at);
  store(hn::ConcatUpperUpper(d, later_odd_15, odd_15), to_t1[1], at);
  store(hn::ConcatUpperUpper(d, later_even_26, even_26), to_t1[2], at);
}

/// Differences of `count` pairs as planes, pair_at(j) the j-th in the batch; the last vector is filled up with copies
/// of the last pair. A vertex at both ends of the step is one vector.
template <BatchKind KIND, class PairAt, class Difference>
HWY_INLINE void gather(const BatchInput& in, const PairAt& pair_at, std::size_t count, const Difference& difference,
                       MotionBlock& block) {
  for (std::size_t j = 0; j < count; j += 8) {
    const std::uint32_t* quads[8];
    for (std::size_t lane = 0; lane < 8; ++lane) {
      quads[lane] = in.quads[pair_at(j + lane < count ? j + lane : count - 1)];
      prefetchPair(in, pair_at(j + lane + PAIRS_AHEAD));
    }
    for (int vector = 0; vector < 3; ++vector) {
      V rows[8];
      for (int lane = 0; lane < 8; ++lane) {
        const std::uint32_t to = quads[lane][ENDS<KIND>[vector][0]], from = quads[lane][ENDS<KIND>[vector][1]];
        rows[lane] = difference(hn::Load(Tag(), in.vertices + std::size_t{8} * to),
                                hn::Load(Tag(), in.vertices + std::size_t{8} * from));
      }
      storeColumns(rows, j, block.motion + 3 * vector, block.motion + U_T1 + 3 * vector);
    }
  }
}
#else
/// The same in plain doubles: scattered stores beat gather instructions on most machines.
template <BatchKind KIND, class PairAt, class Difference>
HWY_INLINE void gather(const BatchInput& in, const PairAt& pair_at, std::size_t count, const Difference& difference,
                       MotionBlock& block) {
  for (std::size_t j = 0; j < count; ++j) {
    const std::uint32_t* quad = in.quads[pair_at(j)];
    prefetchPair(in, pair_at(j + PAIRS_AHEAD));
    const double* x[4];
    for (int i = 0; i < 4; ++i) x[i] = in.vertices + std::size_t{8} * quad[i];
    for (int vector = 0; vector < 3; ++vector) {
      const double *to = x[ENDS<KIND>[vector][0]], *from = x[ENDS<KIND>[vector][1]];
      for (int axis = 0; axis < 3; ++axis) {
        block.motion[3 * vector + axis][j] = difference(to[axis], from[axis]);
        block.motion[U_T1 + 3 * vector + axis][j] = difference(to[4 + axis], from[4 + axis]);
      }
    }
  }
  for (std::size_t j = count; j % lanes() != 0; ++j) {
    for (int k = 0; k < MOTION_PLANES; ++k) block.motion[k][j] = block.motion[k][count - 1];
  }
}
#endif

/// Largest absolute component of a difference over both ends of the step.
HWY_INLINE V sizeOf(const BatchPlane* t0, const BatchPlane* t1, std::size_t i) {
  const V a = hn::Max(hn::Abs(load(t0[0], i)), hn::Abs(load(t1[0], i)));
  const V b = hn::Max(hn::Abs(load(t0[1], i)), hn::Abs(load(t1[1], i)));
  const V c = hn::Max(hn::Abs(load(t0[2], i)), hn::Abs(load(t1[2], i)));
  return hn::Max(hn::Max(a, b), c);
}

HWY_INLINE M withinGuard(V size) {
  return hn::And(hn::Ge(size, constant(BATCH_SMALLEST)), hn::Le(size, constant(BATCH_LARGEST)));
}

/// F0, F1, F2, F3 of one vector of pairs.
HWY_INLINE void coefficients(const BatchPlane* m, std::size_t i, V& f0, V& f1, V& f2, V& f3) {
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
}

/// Appends the pairs of one vector whose bits are set to `to`; first is the position of lane 0 in the batch. Whole
/// vectors are written: the planes leave room for it.
template <bool CERTIFIED>
HWY_INLINE void appendPairs(const BatchPlane* m, std::size_t i, unsigned bits, std::size_t first, V f0, V f1, V f2,
                            V f3, V error, RootBlock& to) {
  const auto front = hn::SetTableIndices(Tag(), FRONT_TABLE.row[bits]);
  const std::size_t at = to.count;
  const auto append = [&front, at](V v, double* plane)
                          HWY_ATTR { hn::StoreU(hn::TableLookupLanes(v, front), Tag(), plane + at); };
  for (int k = 0; k < MOTION_PLANES; ++k) append(load(m[k], i), to.motion[k]);
  append(f0, to.coefficient[0]);
  append(f1, to.coefficient[1]);
  append(f2, to.coefficient[2]);
  append(f3, to.coefficient[3]);
  if (CERTIFIED) {
    append(sizeOf(m + U_T0, m + U_T1, i), to.size[0]);
    append(sizeOf(m + V_T0, m + V_T1, i), to.size[1]);
    append(sizeOf(m + W_T0, m + W_T1, i), to.size[2]);
    append(error, to.error);
  }
  for (; bits != 0; bits &= bits - 1) {
    to.pair[to.count++] = static_cast<std::uint32_t>(first + hwy::Num0BitsBelowLS1Bit_Nonzero32(bits));
  }
}

HWY_INLINE unsigned bitsOf(M mask) {
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(Tag(), mask, bits);
  return bits[0];
}

/// One vector of pairs, of which `rest` or all lanes count: the quick "no" is written out, the others are sorted.
template <bool CERTIFIED>
HWY_INLINE void rejectVector(BatchScratch& scratch, std::size_t i, std::size_t first, std::size_t rest,
                             const BatchOutput& out) {
  const BatchPlane* m = scratch.motion.motion;
  const std::size_t used = rest < lanes() ? rest : lanes();
  const unsigned all = (1u << used) - 1;
  V f0, f1, f2, f3;
  coefficients(m, i, f0, f1, f2, f3);
  V error = hn::Zero(Tag()), error_times_3 = error;
  unsigned checked = all;
  if (CERTIFIED) {
    const V size_u = sizeOf(m + U_T0, m + U_T1, i), size_v = sizeOf(m + V_T0, m + V_T1, i);
    const V size_w = sizeOf(m + W_T0, m + W_T1, i);
    error = hn::Mul(constant(BATCH_VALUE), hn::Mul(hn::Mul(size_u, size_v), size_w));
    error_times_3 = hn::Mul(error, constant(3));
    checked &= bitsOf(hn::And(hn::And(withinGuard(size_u), withinGuard(size_v)), withinGuard(size_w)));
  }
  const M above = hn::And(hn::And(isPositive<CERTIFIED>(f0, error), isPositive<CERTIFIED>(f3, error)),
                          hn::And(isPositive<CERTIFIED>(f1, error_times_3), isPositive<CERTIFIED>(f2, error_times_3)));
  const M below = hn::And(hn::And(isNegative<CERTIFIED>(f0, error), isNegative<CERTIFIED>(f3, error)),
                          hn::And(isNegative<CERTIFIED>(f1, error_times_3), isNegative<CERTIFIED>(f2, error_times_3)));
  const M free = hn::Or(above, below);
  const unsigned left = checked & ~bitsOf(free);
  std::memset(out.verdict + first, BATCH_NO, used);
  for (unsigned failed = all & ~checked; failed != 0; failed &= failed - 1) {
    out.verdict[first + hwy::Num0BitsBelowLS1Bit_Nonzero32(failed)] = BATCH_UNDECIDED;
  }
  if (left == 0) return;
  const unsigned single = left & bitsOf(hasOneRoot<CERTIFIED>(f0, f1, f2, f3, error, error_times_3));
  const unsigned several = left & ~single;
  if (single != 0) appendPairs<CERTIFIED>(m, i, single, first, f0, f1, f2, f3, error, scratch.single);
  if (several != 0) appendPairs<CERTIFIED>(m, i, several, first, f0, f1, f2, f3, error, scratch.several);
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();
