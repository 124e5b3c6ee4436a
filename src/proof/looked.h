// What the stages of a part of a step have looked at. Nothing counts as looked at by default: a stage that ends early
// leaves a gap, and so does one that is not called.
#pragma once

#include <cstdint>
#include <vector>

#include "dccd/body.h"
#include "dccd/outcome.h"

namespace dccd {

class Looked {
 public:
  /// A part begins.
  void begin();

  /// All pairs of different bodies were compared by their bounds, and all are apart but these, flattened, the smaller
  /// number first.
  void compared(const std::vector<std::uint32_t>& near);
  /// All pairs of features of this kind were accounted for, the first ones of body a.
  void at(PairKind kind, std::size_t a, std::size_t b);
  /// All pairs of a body's own features.
  void atItself(std::size_t body);
  void atMap(std::size_t body);
  /// Whether anything crosses or is inside of something when the part begins, of all partners but the map.
  void atStart() { start_ = true; }

  /// What nobody looked at of that which is asked of the bodies (body.h); the claim says how long the part is.
  std::vector<Gap> gaps(const std::vector<Body>& bodies, bool has_map, bool has_start);

 private:
  struct Mark {
    std::uint32_t bodies;  ///< the smaller number << 16 | the other one
    std::uint8_t tests;
  };
  void mark(std::size_t a, std::size_t b, std::uint8_t tests);
  bool holds(std::size_t a, std::size_t b, std::uint8_t tests) const;

  std::vector<Mark> marks_;
  std::vector<std::uint32_t> near_;
  bool compared_ = false, start_ = false;
};

}  // namespace dccd
