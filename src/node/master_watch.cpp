#include "node/master_watch.h"

#include <algorithm>
#include <chrono>
#include <new>
#include <utility>

#include "input/master_question.h"

namespace dccd {
namespace {

constexpr std::chrono::milliseconds PERIOD{50};
constexpr double TIMEOUT_S = 0.5;
constexpr std::chrono::seconds LOOK_AT_PARAMETERS{1};

}  // namespace

MasterWatch::MasterWatch(const std::vector<std::unique_ptr<MeshSubscription>>& meshes,
                         const std::vector<ros::Subscriber>& maps, std::function<void()> answered,
                         std::function<void()> map_published)
    : meshes_(meshes), maps_(maps), answered_(std::move(answered)), map_published_(std::move(map_published)) {}

void MasterWatch::watchParameters(std::map<std::string, std::string> held,
                                  std::function<void(std::vector<std::string>)> changed) {
  held_ = std::move(held);
  changed_ = std::move(changed);
}

void MasterWatch::start() {
  thread_ = std::thread([this] { loop(); });
}

MasterWatch::~MasterWatch() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  ended_.notify_all();
  if (thread_.joinable()) thread_.join();
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
      lookAtParameters();
    } catch (const std::bad_alloc&) {  // it looks again
    }
    lock.lock();
  }
}

/// One that is gone, or a master that is, has not said anything else.
void MasterWatch::lookAtParameters() {
  const auto now = std::chrono::steady_clock::now();
  if (held_.empty() || now - looked_ < LOOK_AT_PARAMETERS) return;
  looked_ = now;
  std::vector<std::string> changed;
  for (const auto& [name, text] : held_) {
    XmlRpc::XmlRpcValue value;
    if (!askMaster("getParam", name, TIMEOUT_S, value)) continue;
    const bool is_text = value.getType() == XmlRpc::XmlRpcValue::TypeString;
    if (is_text && static_cast<std::string&>(value) != text) changed.push_back(name);
  }
  if (changed != std::exchange(told_changed_, changed)) changed_(changed);
}

void MasterWatch::look() {
  const auto isPublished = [](const ros::Subscriber& map) { return map.getNumPublishers() > 0; };
  if (std::any_of(maps_.begin(), maps_.end(), isPublished)) map_published_();
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
