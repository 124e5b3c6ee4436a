// Two bumpy sheets of 4 x 4 vertices, one above the other, and what is said of a step of them.
#pragma once

#include "support/shapes.h"

namespace dccd {
namespace test {

inline Positions sheetAt(double z) {
  Positions points;
  for (int i = 0; i < 16; ++i) points.push_back({0.1 * (i % 4), 0.1 * (i / 4), z + 0.001 * ((7 * i) % 5)});
  return points;
}

/// The lower one rests at the height 0.
struct TwoSheets {
  Step step;
  Options options;

  TwoSheets(double from_z, double to_z) {
    const Topology sheet = Topology::grid(4, 4);
    step.bodies = {moving(bodyOf("upper", sheet), sheetAt(from_z), sheetAt(to_z)),
                   moving(bodyOf("lower", sheet), sheetAt(0), sheetAt(0))};
    step.stamp_ns = 100000000;
  }
  Body& upper() { return step.bodies[0]; }
  Outcome answer() const {
    History history;
    return detect(step, options, history);
  }
};

}  // namespace test
}  // namespace dccd
