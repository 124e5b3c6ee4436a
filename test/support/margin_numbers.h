// Numbers and vectors for inputs that aim at the bound of a margin, and exact numbers to judge them by.
#pragma once

#include <Eigen/Core>
#include <array>

#include "oracle/algebraic.h"
#include "support/margin_checks.h"

namespace dccd {
namespace test {
namespace margins {

using V3 = Eigen::Vector3d;

double uniform(RandomSource& random);  ///< from -1 to 1
double share(RandomSource& random);    ///< from 0 to 1
/// Of a random size, 2^from to 2^(to + 1).
double power(RandomSource& random, int from, int to);
/// Where roundings weigh most: a little more than a power of two.
double heavy(RandomSource& random);

V3 heavyVector(RandomSource& random);
V3 anyVector(RandomSource& random);
/// Where a pair lies: anywhere, or so that the place where it meets is at the origin, whose neighbours are so close
/// that a pair can be nearly exactly at a bound, while all that is far from there is rounded.
V3 originOf(RandomSource& random, const V3& meeting_place);

/// One number to a neighbour, or a little further.
void changeOne(MarginInput& input, RandomSource& random);

Rational exact(double x);
int signOf(const Rational& x);
Rational determinant(const std::array<std::array<Rational, 3>, 3>& x);

}  // namespace margins
}  // namespace test
}  // namespace dccd
