// First stage of the batched elementary test: see exact_batch-inl.h, which includes this.
HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {

/// Differences of pairs first .. first+count-1 as planes; the last vector is filled up with copies of the last pair.
/// Plain doubles: scattered stores beat gather instructions on most machines.
template <BatchKind KIND>
HWY_INLINE void gather(const BatchInput& in, std::size_t first, std::size_t count, MotionBlock& block) {
  constexpr std::size_t AHEAD = 16;
  constexpr bool VF = KIND == BatchKind::VERTEX_FACE;
  for (std::size_t j = 0; j < count; ++j) {
    const std::uint32_t* quad = in.quads[first + j];
    if (first + j + AHEAD < in.count) {
      const std::uint32_t* later = in.quads[first + j + AHEAD];
      for (int i = 0; i < 4; ++i) hwy::Prefetch(in.vertices + std::size_t{8} * later[i]);
    }
    const double* x0 = in.vertices + std::size_t{8} * quad[0];
    const double* x1 = in.vertices + std::size_t{8} * quad[1];
    const double* x2 = in.vertices + std::size_t{8} * quad[2];
    const double* x3 = in.vertices + std::size_t{8} * quad[3];
    for (int end = 0; end < 2; ++end) {
      for (int axis = 0; axis < 3; ++axis) {
        const int k = 4 * end + axis, plane = 9 * end + axis;
        block.motion[U_T0 + plane][j] = VF ? x2[k] - x1[k] : x1[k] - x0[k];
        block.motion[V_T0 + plane][j] = VF ? x3[k] - x1[k] : x3[k] - x2[k];
        block.motion[W_T0 + plane][j] = VF ? x0[k] - x1[k] : x2[k] - x0[k];
      }
    }
  }
  for (std::size_t j = count; j % lanes() != 0; ++j) {
    for (int k = 0; k < MOTION_PLANES; ++k) block.motion[k][j] = block.motion[k][count - 1];
  }
}

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
