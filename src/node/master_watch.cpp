#include "node/master_watch.h"

#include <chrono>
#include <new>
#include <utility>

#include "input/master_question.h"

namespace dccd {
namespace {

constexpr std::chrono::milliseconds PERIOD{50};
constexpr double TIMEOUT_S = 0.5;

}  // namespace

MasterWatch::MasterWatch(const std::vector<std::unique_ptr<MeshSubscription>>& meshes, const ros::Subscriber& map,
                         std::function<void()> answered, std::function<void()> map_published)
    : meshes_(meshes),
      map_(map),
      answered_(std::move(answered)),
      map_published_(std::move(map_published)),
      thread_([this] { loop(); }) {}

MasterWatch::~MasterWatch() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  ended_.notify_all();
  thread_.join();
}

void MasterWatch::lookInto(SilenceQuestion question) {
  const std::lock_guard<std::mutex> lock(mutex_);
  question_ = std::move(question);
}

std::optional<std::string> MasterWatch::takeHint() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::exchange(hint_, {});
}

void MasterWatch::loop() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!ended_.wait_for(lock, PERIOD, [this] { return stopping_; })) {
    lock.unlock();
    try {
      look();
    } catch (const std::bad_alloc&) {  // it looks again
    }
    lock.lock();
  }
}

void MasterWatch::look() {
  if (map_ && map_.getNumPublishers() > 0) map_published_();
  std::vector<MeshSubscription*> wanting;
  for (const auto& mesh : meshes_) {
    if (mesh && mesh->wantsRenewal()) wanting.push_back(mesh.get());
  }
  std::optional<SilenceQuestion> question;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    question = std::exchange(question_, {});
  }
  if (wanting.empty() && !question) return;
  const auto published = publishedTopics(TIMEOUT_S);
  // Without an answer nothing is renewed: roscpp's call would hang with the master.
  if (published) {
    for (MeshSubscription* mesh : wanting) mesh->renew(*published);
  }
  if (!question) return;
  const auto topics = published.value_or(std::map<std::string, std::string>());
  std::string hint = silenceHint(question->silent, topics);
  const std::string maps = question->map_topic.empty() ? "" : unheardMapsHint(question->map_topic, topics);
  if (!maps.empty()) hint += (hint.empty() ? "" : "; ") + maps;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    hint_ = std::move(hint);
  }
  answered_();
}

}  // namespace dccd
