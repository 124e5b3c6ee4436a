// The true contacts and the true start state of a step, straight from the definition: what judges the detector as a
// whole.
#pragma once

#include <vector>

#include "support/step_support.h"

namespace dccd {
namespace test {

struct TrueContact {
  Contact contact;  ///< toc 0 to 1
  Root toc;
};
/// Every pair that the setups ask for, by the oracle, in canonical order.
std::vector<TrueContact> trueContacts(const TestStep& step);

/// Whether the segment and the triangle meet, by the oracle: a vertex on its way from one end to the other.
bool trulyMeet(const Vec3& p, const Vec3& q, const Vec3& a, const Vec3& b, const Vec3& c);
/// Every edge that meets a face at t=0, in the order that the detector lists them.
std::vector<StartIntersection> trueIntersections(const TestStep& step);
/// The first vertex of every piece of a body that lies in another, closed body at t=0, in the order that the detector
/// lists them, after the edges.
std::vector<StartIntersection> trueInsides(const TestStep& step);
/// Both.
std::vector<StartIntersection> trueStart(const TestStep& step);

}  // namespace test
}  // namespace dccd
