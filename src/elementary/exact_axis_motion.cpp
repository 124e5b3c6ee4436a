// Motion along one axis. Where the other two coordinates of all four points rest, what is seen along that axis rests,
// and f is linear in t, since only one factor of each of its terms moves. So one look tells whether the features can
// meet, and two values of f when. Edges that are seen as one line meet, if not at t = 0, with an end first: how high an
// end is above the other edge is linear in t, too.
#include "elementary/exact_frozen_pair.h"
#include "elementary/exact_tiers.h"

namespace dccd {
namespace exact {
namespace {

constexpr std::int64_t NEVER = -1, NOT_KNOWN = -2;

/// The cell of the root of a linear function with these values at t = 0 and t = 1; NEVER without a sign change.
template <int LIMBS>
std::int64_t cellOfLinear(const ShortInteger<LIMBS>& at_0, const ShortInteger<LIMBS>& at_1, int toc_bits) {
  const int sign = at_0.sign();
  if (sign == 0) return 0;
  if (at_1.sign() == sign) return NEVER;
  const std::int64_t cells = std::int64_t{1} << toc_bits;
  if (at_1.sign() == 0) return cells;
  const auto sign_at = [&](std::int64_t k) {
    const ShortInteger<1> before = {{static_cast<std::uint64_t>(cells - k)}}, after = {{static_cast<std::uint64_t>(k)}};
    return (at_0 * before + at_1 * after).sign();
  };
  const double share = at_0.approximate() / (at_0.approximate() - at_1.approximate());
  auto k = static_cast<std::int64_t>(share * static_cast<double>(cells));
  for (int i = 0; i < 8; ++i) {
    if (k < 0 || k >= cells) return NOT_KNOWN;
    if (sign_at(k) == -sign) {
      --k;
    } else if (sign_at(k + 1) != -sign) {
      ++k;
    } else {
      return k;
    }
  }
  return NOT_KNOWN;
}

/// The axis along which alone the points move; -1 where there is none.
int axisOfMotion(const PairMotion& pair) {
  int axis = -1;
  for (int k = 0; k < 3; ++k) {
    bool moves = false;
    for (int i = 0; i < 4; ++i) moves |= pair.x[0][i][k] != pair.x[1][i][k];
    if (!moves) continue;
    if (axis >= 0) return -1;
    axis = k;
  }
  return axis;
}

/// Edges that are seen as parts of one line along axis k, and do not meet at t = 0.
template <int N>
std::int64_t cellOnOneLine(const Frozen<N>& start, const Frozen<N>& end, int k, int toc_bits) {
  static constexpr int ENDS[4][3] = {{0, 2, 3}, {1, 2, 3}, {2, 0, 1}, {3, 0, 1}};
  if (start.coincideAlong(k, 0, 1) || start.coincideAlong(k, 2, 3)) return NOT_KNOWN;
  std::int64_t first = NEVER;
  for (const auto& points : ENDS) {
    const int p = points[0], a = points[1], b = points[2], i = start.extentBeside(k, a, b);
    if (!start.isBetweenAlong(k, p, a, b)) continue;
    const std::int64_t cell = cellOfLinear(start.heightAbove(k, i, p, a, b), end.heightAbove(k, i, p, a, b), toc_bits);
    if (cell == NOT_KNOWN) return NOT_KNOWN;
    if (cell != NEVER && (first == NEVER || cell < first)) first = cell;
  }
  return first;
}

/// Cell of the contact of a pair that moves along axis k alone; NEVER for none, NOT_KNOWN where this cannot tell.
template <int N>
std::int64_t cellAlongAxis(PairKind kind, const PairMotion& pair, int k, int toc_bits) {
  Frozen<N> start, end;
  if (!start.set(kind, pair, {0, 1}) || !end.set(kind, pair, {1, 1})) return NOT_KNOWN;
  if (start.normalSign(k) != 0) {
    return start.meetAlong(k) ? cellOfLinear(start.volume(), end.volume(), toc_bits) : NEVER;
  }
  if (kind == PairKind::VERTEX_FACE) return NOT_KNOWN;
  if (start.areBesideAlong(k)) return NEVER;
  if (start.volume().sign() == 0 && start.meet()) return 0;
  return cellOnOneLine(start, end, k, toc_bits);
}

}  // namespace

ElementaryResult decideAlongAxis(PairKind kind, const PairMotion& pair, int toc_bits) {
  const int k = axisOfMotion(pair);
  if (k < 0) return undecided(Tier::FIXED_INTEGER);
  std::int64_t cell = cellAlongAxis<1>(kind, pair, k, toc_bits);
  if (cell == NOT_KNOWN) cell = cellAlongAxis<2>(kind, pair, k, toc_bits);
  if (cell == NOT_KNOWN) return undecided(Tier::FIXED_INTEGER);
  return cell == NEVER ? noContact(Tier::FIXED_INTEGER) : contactInCell(cell, toc_bits, Tier::FIXED_INTEGER);
}

}  // namespace exact
}  // namespace dccd
