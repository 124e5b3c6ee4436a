// What an input declares, and what became of it.
#pragma once

#include <algorithm>
#include <cstddef>

namespace dccd {

/// Whoever goes through an input declares all that is in it: statements, rows, polygons, points. Who reads something of
/// it, knows that it has no geometry, or leaves it out as the configuration says, accounts for it. The rest is
/// unchecked: what a reader passes over costs the proof, whether somebody thought of it or not.
class Census {
 public:
  void declare(std::size_t count = 1) { declared_ += count; }
  void account(std::size_t count = 1) { accounted_ += count; }
  std::size_t unchecked() const { return declared_ - std::min(declared_, accounted_); }

 private:
  std::size_t declared_ = 0, accounted_ = 0;
};

}  // namespace dccd
