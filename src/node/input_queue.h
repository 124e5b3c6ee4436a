// Messages on their way from callbacks to the worker: bounded, counted, and never a reason to block.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "config/monitor_config.h"
#include "input/mesh_message.h"

namespace dccd {

/// What a service answers.
struct Reply {
  bool success = false;
  std::string message;
};

/// One queue a body, and commands for the worker. Safe to call from any thread.
class InputQueue {
 public:
  /// `max_bytes`: of the messages of all bodies; 0: no limit.
  InputQueue(std::size_t bodies, std::size_t capacity, QueuePolicy policy, std::size_t max_bytes = 0);

  /// Before the first message: this body's newest message is never the one that is dropped.
  void keepNewest(std::size_t body) { policies_[body] = QueuePolicy::NEWEST; }
  /// A full queue drops its oldest messages (newest, thin) or this one (oldest), and counts them; so does one for which
  /// there is no room in bytes beside the others. One that has no room at all is kept without its content. `thin`: the
  /// next message says how many were left out before it.
  void push(std::size_t body, MeshMessage message);
  /// False when the body has none.
  bool pop(std::size_t body, MeshMessage& message);
  /// Drops all messages of all bodies but the `spared` ones (none where it is empty); returns how many of each.
  std::vector<std::uint64_t> clear(const std::vector<bool>& spared = {});
  /// Messages dropped since the last call, per body.
  std::vector<std::uint64_t> takeDropped();
  std::size_t size(std::size_t body) const;

  /// For the worker to run between steps.
  void command(std::function<void()> run);
  /// The same, and waits for the answer. Without success: what `run` throws, in words; a timeout, after which the
  /// command is still carried out when its turn comes; a closed queue.
  Reply call(const std::function<Reply()>& run, double timeout_s);
  /// The worker has ended: what it has not run is dropped, and so is all that follows, so that no call waits for it.
  void close();
  /// Waits for a message, a command, a wake-up or the timeout; returns the commands that arrived.
  std::vector<std::function<void()>> wait(std::chrono::microseconds timeout);
  void wake();

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::deque<MeshMessage>> queues_;
  std::vector<std::uint64_t> dropped_;
  std::vector<QueuePolicy> policies_;
  std::vector<std::function<void()>> commands_;
  std::size_t capacity_, max_bytes_, bytes_ = 0;
  bool woken_ = false, closed_ = false;
};

}  // namespace dccd
