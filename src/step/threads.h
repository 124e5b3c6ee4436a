// The threads of a step.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <cstddef>
#include <memory>

#include "simd/float_mode.h"
#include "step/fork_join.h"

namespace dccd {

class Threads {
 public:
  void set(int count) {
    if (count == count_) return;
    arena_ = std::make_unique<tbb::task_arena>(count);
    count_ = count;
  }
  std::size_t count() const { return static_cast<std::size_t>(count_); }

  /// Calls function(first, last) over [0, n), in pieces of that size side by side; with one thread, or where there is
  /// only one piece, all of it at once.
  template <class Function>
  void operator()(std::size_t n, std::size_t piece, const Function& function) const {
    if (count_ == 1 || n <= piece) {
      function(0, n);
      return;
    }
    const auto in_mode = [&](std::size_t first, std::size_t last) {
      const ScopedFloatMode mode;
      function(first, last);
    };
    ForkJoin::fork();
    arena_->execute([&] {
      tbb::parallel_for(
          tbb::blocked_range<std::size_t>(0, n, piece),
          [&](const tbb::blocked_range<std::size_t>& r)
              DEFORMABLE_CCD_COPIED_BY_TBB { ForkJoin::piece(in_mode, r.begin(), r.end()); },
          tbb::simple_partitioner());
    });
    ForkJoin::join();
  }

 private:
  int count_ = 0;
  std::unique_ptr<tbb::task_arena> arena_;
};

}  // namespace dccd
