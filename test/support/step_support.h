// Small steps made to be hard, and how a test runs and describes one.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "oracle/oracle.h"
#include "support/detector.h"

namespace dccd {
namespace test {

/// An integer between the two, ends included: from a random source, or from the bytes of a fuzzer.
using Draw = std::function<int(int low, int high)>;
Draw drawFrom(std::uint64_t seed);

/// A body with everything that its step needs.
struct StepBody {
  Topology topology;
  Positions t0, t1;
  bool self_collision = true, against_bodies = true, shell = false;
  std::vector<std::uint8_t> vertex_active;  ///< empty: all
};

struct TestStep {
  std::vector<StepBody> bodies;
  Step motion() const;  ///< bodies are called body_0, body_1 ...
  /// The next step: what was t=1 is t=0, and the positions at t=1 are given.
  TestStep continued(std::vector<Positions> t1) const;
};

/// How coordinates are made.
enum class Coordinates : std::uint8_t {
  SMALL_INTEGERS = 0,  ///< -3 to 3 at both times
  FEW_BITS,            ///< six-bit multiples of a power of two
  REAL,                ///< all bits in use
  LITTLE_MOTION,       ///< all bits in use, motion down to one ulp
  HUGE_OFFSET,         ///< small integers far from the origin
  FLAT,                ///< everything in one plane during the whole step
  AT_REST,             ///< no motion
  COINCIDENT,          ///< vertices in the same few places
  SUBNORMAL,           ///< below the smallest normal double
  EXTREME,             ///< sums of coordinates overflow
  COUNT
};

/// One to three bodies of at most `triangles` triangles altogether (or ropes), of any shape: grids, strips, single
/// triangles, faces on random vertices, non-manifold ones included.
TestStep randomStep(const Draw& draw, int triangles, Coordinates coordinates);
TestStep randomStep(const Draw& draw, int triangles);
/// Positions of one body, of the style given.
Positions randomPositions(const Draw& draw, std::size_t count, Coordinates coordinates);
/// t0 moved the way the style moves.
Positions randomMotion(const Draw& draw, const Positions& t0, Coordinates coordinates);
/// At most so many triangles, over at most 3 * triangles vertices.
Topology randomTopology(const Draw& draw, int triangles);

/// The motion of a contact's four vertices.
PairMotion motionOf(const TestStep& step, const Contact& contact);

/// One step with a detector of its own, as a first step.
Outcome runOnce(const TestStep& step, const Options& options);
/// Crumpled cloths of size x size vertices that move through each other and through themselves: thousands of contacts.
TestStep crumpled(std::uint64_t seed, int bodies, std::size_t size);
/// Two triangles, one above the inside of the other at t=0; its lowest corner arrives at t=0.5 and passes through.
TestStep crossing();

/// Runs `body` for every SIMD target that this machine has, by its name; the choice is undone afterwards.
void forEachSimdTarget(const std::function<void(const std::string& target)>& body);

/// What differs, in words; empty where the contacts are the same bit for bit.
std::string difference(const std::vector<Contact>& x, const std::vector<Contact>& y);
std::string describe(const Contact& contact);
bool operator==(const StartIntersection& x, const StartIntersection& y);

}  // namespace test
}  // namespace dccd
