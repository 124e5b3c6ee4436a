// Who reads a step's distances, where that is not everybody: most pairs are so far that nothing of what is read would
// be otherwise, were they farther still. How far these are takes most of the time.
#pragma once

#include <cstdint>

namespace dccd {

class DistanceReaders {
 public:
  virtual ~DistanceReaders() = default;
  /// Two that are not expected to touch, and how far apart they are at the most [m], at the step's end and over it.
  virtual void take(std::uint16_t a, std::uint16_t b, double end_m, double step_m) = 0;
  /// By all that was taken: of two that are farther than this [m] nothing else is read. Infinite: something is.
  virtual double enoughFor(std::uint16_t a, std::uint16_t b) const = 0;
};

}  // namespace dccd
