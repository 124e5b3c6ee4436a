// What ThreadSanitizer is told of a parallel loop. TBB, which is built without it, starts the pieces and waits for
// them, so that it would call each use of a piece's results a race. Races between pieces stay what they are.
#pragma once

#include <cstddef>

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
// For the lambda that TBB copies from task to task: who wrote the copy, TBB alone knows. What it calls is looked at.
#define DEFORMABLE_CCD_COPIED_BY_TBB __attribute__((no_sanitize("thread")))
#else
#define DEFORMABLE_CCD_COPIED_BY_TBB
#endif

namespace dccd {

/// fork() before the loop, piece() in it, join() after it.
class ForkJoin {
 public:
  template <class Body>
  static void piece(const Body& body, std::size_t first, std::size_t last) {
    acquire(fork_);
    body(first, last);
    release(join_);
  }
  static void fork() { release(fork_); }
  static void join() { acquire(join_); }

 private:
#if defined(__SANITIZE_THREAD__)
  static void acquire(char& order) { __tsan_acquire(&order); }
  static void release(char& order) { __tsan_release(&order); }
#else
  static void acquire(char&) {}
  static void release(char&) {}
#endif
  static inline char fork_ = 0, join_ = 0;
};

}  // namespace dccd
