// What ThreadSanitizer is told of a parallel loop. TBB, which is built without it, starts the pieces and waits for them, so
// that it would call each use of a piece's results a race. Races between pieces stay what they are.
#pragma once

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#endif

namespace deformable_ccd {

/// Static, since a piece may not even read its loop's own variables before it is told that they were written.
class ForkJoin {
 public:
#if defined(__SANITIZE_THREAD__)
  static void fork() { __tsan_release(&fork_); }   ///< before the loop
  static void begin() { __tsan_acquire(&fork_); }  ///< of a piece
  static void end() { __tsan_release(&join_); }    ///< of a piece
  static void join() { __tsan_acquire(&join_); }   ///< after the loop

 private:
  static inline char fork_ = 0, join_ = 0;
#else
  static void fork() {}
  static void begin() {}
  static void end() {}
  static void join() {}
#endif
};

}  // namespace deformable_ccd
