// What ThreadSanitizer is told of a parallel loop. TBB, which is built without it, starts the pieces and waits for them, so
// that it would call each use of a piece's results a race. Races between pieces stay what they are.
#pragma once

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#endif

namespace deformable_ccd {

/// One for each loop, made before it.
class ForkJoin {
 public:
#if defined(__SANITIZE_THREAD__)
  ForkJoin() { __tsan_release(&fork_); }
  void begin() { __tsan_acquire(&fork_); }  ///< of a piece
  void end() { __tsan_release(&join_); }    ///< of a piece
  void join() { __tsan_acquire(&join_); }   ///< after the loop

 private:
  char fork_ = 0, join_ = 0;
#else
  void begin() {}
  void end() {}
  void join() {}
#endif
};

}  // namespace deformable_ccd
