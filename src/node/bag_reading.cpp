#include "node/bag_reading.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>
#include <stdexcept>
#include <vector>

#include "base/regular_file.h"
#include "input/message_bytes.h"
#include "input/short_text.h"

namespace dccd {
namespace {

// Transforms are fed this far ahead of the meshes and kept this long behind them; so a long bag needs no more memory.
const ros::Duration TF_AHEAD(10.0);
const ros::Duration TF_KEPT(60.0);
// Where stamps go back (a recorded loop), transforms and meshes are recorded this much apart at most.
const ros::Duration SEAM(1.0);

const std::string MARK = "#ROSBAG V", MARK_OF_2 = MARK + "2.0\n";

/// Looks at each length and place in a bag of version 2.0. rosbag trusts them and reads past its buffers where one is
/// wrong. What is in compressed chunks has a checksum of its own.
class BagCheck {
 public:
  explicit BagCheck(const std::string& path) : file_(path, std::ios::binary), size_(std::filesystem::file_size(path)) {}

  /// By what the index says of each chunk.
  std::optional<BagSpan> span() {
    if (textAt(0, std::min<std::uint64_t>(size_, MARK_OF_2.size())) != MARK_OF_2) return std::nullopt;
    const Record first = recordAt(MARK_OF_2.size(), size_);
    BagSpan span;
    std::uint64_t left = number<std::uint32_t>(first, "conn_count");
    left += number<std::uint32_t>(first, "chunk_count");
    for (auto at = number<std::uint64_t>(first, "index_pos"); left > 0 && at > 0 && at < size_; --left) {
      const Record record = recordAt(at, size_);
      at = record.end;
      if (record.op() != CHUNK_INFO || number<std::uint32_t>(record, "count") == 0) continue;
      span.begin = std::min(span.begin, time(record, "start_time"));
      span.end = std::max(span.end, time(record, "end_time"));
    }
    return span;
  }

  /// Throws rosbag::BagFormatException naming the first byte of a record that is none.
  void check() {
    if (textAt(0, std::min<std::uint64_t>(size_, MARK_OF_2.size())) != MARK_OF_2) return;
    const Record first = recordAt(MARK_OF_2.size(), size_);
    const auto index_at = number<std::uint64_t>(first, "index_pos");
    const auto encryptor = first.fields.find("encryptor");
    if (index_at == 0 || (encryptor != first.fields.end() && !encryptor->second.empty())) return;  // rosbag refuses it
    std::uint64_t left = number<std::uint32_t>(first, "conn_count");
    left += number<std::uint32_t>(first, "chunk_count");
    bool in_index = false;
    std::set<std::uint64_t> chunks;
    std::vector<Record> infos;
    std::optional<std::set<std::uint32_t>> messages;
    for (std::uint64_t at = first.end; left > 0;) {
      if (at < index_at && areZeros(at, index_at)) at = index_at;
      const Record record = recordAt(at, size_);
      in_index = in_index || at == index_at;
      left -= in_index;
      if (record.op() == CHUNK) {
        chunks.insert(at);
        messages.reset();
        if (text(record, "compression") == "none") messages = messagesIn(record);
      } else if (record.op() == INDEX && messages) {
        checkPlaces(record, *messages);
      } else if (record.op() == CHUNK_INFO) {
        infos.push_back(record);
      }
      at = record.end;
    }
    for (const Record& info : infos) {
      if (chunks.count(number<std::uint64_t>(info, "chunk_pos")) == 0) fail(info.at);
    }
  }

 private:
  static constexpr char MESSAGE = 2, INDEX = 4, CHUNK = 5, CHUNK_INFO = 6;
  static constexpr std::uint64_t ENTRY = 12;             // bytes in an index: time and place
  static constexpr std::uint64_t MOST_HEADER = 1 << 20;  // bytes; those of rosbag have a hundred
  struct Record {
    std::uint64_t at = 0, data = 0, end = 0;
    std::map<std::string, std::string> fields;
    char op() const { return fields.at("op")[0]; }
  };
  std::ifstream file_;
  std::uint64_t size_;

  [[noreturn]] static void fail(std::uint64_t at) {
    throw rosbag::BagFormatException("the record at byte " + std::to_string(at) + " is none");
  }
  void readTo(void* to, std::uint64_t at, std::uint64_t size) {
    file_.seekg(static_cast<std::streamoff>(at));
    if (!file_.read(static_cast<char*>(to), static_cast<std::streamsize>(size))) fail(at);
  }
  std::string textAt(std::uint64_t at, std::uint64_t size) {
    std::string text(size, '\0');
    readTo(text.data(), at, size);
    return text;
  }
  /// What rosbag reindex of ros_comm 1.15.9 (Debian 11) leaves where it cut a bag.
  bool areZeros(std::uint64_t at, std::uint64_t end) {
    constexpr std::uint64_t MOST = 64 << 20;  // bytes: it cuts a chunk, of a second or of a message
    if (end > size_ || end - at < 4 || end - at > MOST || numberAt(at) != 0) return false;
    return textAt(at, end - at).find_first_not_of('\0') == std::string::npos;
  }
  std::uint32_t numberAt(std::uint64_t at) {
    std::uint32_t number = 0;
    readTo(&number, at, sizeof number);
    return number;
  }
  /// What lies at `at`, with its length before it and no further than `end`.
  std::uint64_t endOf(std::uint64_t at, std::uint64_t end) {
    if (end - at < 4) fail(at);
    const std::uint32_t size = numberAt(at);
    if (size > end - at - 4) fail(at);
    return at + 4 + size;
  }
  Record recordAt(std::uint64_t at, std::uint64_t end) {
    Record record;
    record.at = at;
    const std::uint64_t header_end = endOf(at, end);
    if (header_end - at > MOST_HEADER) fail(at);
    const auto header = textAt(at + 4, header_end - at - 4);
    for (std::size_t i = 0; i < header.size();) {
      std::uint32_t size = 0;
      if (header.size() - i < sizeof size) fail(at);
      std::memcpy(&size, header.data() + i, sizeof size);
      i += sizeof size;
      if (size > header.size() - i) fail(at);
      const std::string field = header.substr(i, size);
      const std::size_t equals = field.find('=');
      if (equals == std::string::npos) fail(at);
      record.fields[field.substr(0, equals)] = field.substr(equals + 1);
      i += size;
    }
    if (text(record, "op").size() != 1) fail(at);
    record.data = header_end + 4;
    record.end = endOf(header_end, end);
    return record;
  }
  static std::string text(const Record& record, const std::string& name) {
    const auto field = record.fields.find(name);
    if (field == record.fields.end()) fail(record.at);
    return field->second;
  }
  template <class Number>
  static Number number(const Record& record, const std::string& name) {
    const std::string bytes = text(record, name);
    Number value = 0;
    if (bytes.size() != sizeof value) fail(record.at);
    std::memcpy(&value, bytes.data(), sizeof value);
    return value;
  }
  static ros::Time time(const Record& record, const std::string& name) {
    const auto both = number<std::uint64_t>(record, name);
    return {static_cast<std::uint32_t>(both), static_cast<std::uint32_t>(both >> 32)};
  }
  std::set<std::uint32_t> messagesIn(const Record& chunk) {
    std::set<std::uint32_t> places;
    for (std::uint64_t at = chunk.data; at < chunk.end;) {
      const Record record = recordAt(at, chunk.end);
      if (record.op() == MESSAGE) places.insert(static_cast<std::uint32_t>(at - chunk.data));
      at = record.end;
    }
    return places;
  }
  void checkPlaces(const Record& index, const std::set<std::uint32_t>& messages) {
    const auto count = number<std::uint32_t>(index, "count");
    if (count * ENTRY != index.end - index.data) fail(index.at);
    const std::string entries = textAt(index.data, count * ENTRY);
    for (std::size_t i = 0; i < entries.size(); i += ENTRY) {
      std::uint32_t place = 0;
      std::memcpy(&place, entries.data() + i + ENTRY - sizeof place, sizeof place);
      if (messages.count(place) == 0) fail(index.at);
    }
  }
};

}  // namespace

void openBag(const std::string& path, rosbag::Bag& bag) {
  // rosbag reads a device for its first line until memory is gone.
  if (const std::string problem = regularFileProblem(path); !problem.empty()) {
    throw std::runtime_error(path + ": " + problem);
  }
  const std::string hint = "; run: rosbag reindex " + path;
  try {
    BagCheck(path).check();
    bag.open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagUnindexedException&) {
    throw std::runtime_error(path + ": the bag has no index, as its recording was not ended" + hint);
  } catch (const rosbag::BagException& error) {
    std::string begin(MARK.size(), '\0');
    std::ifstream file(path, std::ios::binary);
    file.read(begin.data(), static_cast<std::streamsize>(begin.size()));
    if (file.gcount() == 0) throw std::runtime_error(path + ": the file is empty: nothing was recorded");
    if (begin != MARK) throw std::runtime_error(path + ": the file is no bag: it does not begin with '" + MARK + "'");
    throw std::runtime_error(path + ": the bag is cut or damaged (" + shortText(error.what()) + ")" + hint);
  }
}

std::optional<BagSpan> spanOf(const std::string& path) {
  if (!regularFileProblem(path).empty()) return std::nullopt;
  try {
    return BagCheck(path).span();
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

std::string bagTopic(const std::string& topic) { return topic.empty() || topic[0] == '/' ? topic : "/" + topic; }

StampNs receiptOf(const rosbag::MessageInstance& message) { return static_cast<StampNs>(message.getTime().toNSec()); }

OpenBags::OpenBags(const std::vector<std::string>& paths) : paths_(paths) {
  for (std::size_t i = 0; i < paths.size(); ++i) {
    std::error_code error;
    for (std::size_t j = 0; j < i; ++j) {
      if (std::filesystem::equivalent(paths[i], paths[j], error))
        throw std::runtime_error(paths[i] + ": is given twice");
    }
  }
  if (paths.size() > 1) {
    std::map<std::string, ros::Time> begins;
    for (const std::string& path : paths) {
      const std::optional<BagSpan> span = spanOf(path);
      begins[path] = span ? span->begin : ros::TIME_MAX;
    }
    std::stable_sort(paths_.begin(), paths_.end(),
                     [&](const std::string& a, const std::string& b) { return begins[a] < begins[b]; });
  }
  for (const std::string& path : paths_) {
    bags_.push_back(std::make_unique<rosbag::Bag>());
    openBag(path, *bags_.back());
  }
}

tf2_msgs::TFMessage staticsOf(const std::string& path) {
  rosbag::Bag bag;
  openBag(path, bag);
  rosbag::View view(bag, rosbag::TopicQuery("/tf_static"));
  std::map<std::string, geometry_msgs::TransformStamped> found;
  for (const rosbag::MessageInstance& m : view) {
    const auto tf = m.isType<tf2_msgs::TFMessage>() ? m.instantiate<tf2_msgs::TFMessage>() : nullptr;
    if (!tf) throw std::runtime_error(path + ": its /tf_static holds " + m.getDataType() + ", which is not read");
    for (const auto& one : tf->transforms) {
      const auto [known, is_new] = found.try_emplace(one.child_frame_id, one);
      if (is_new ||
          (known->second.transform == one.transform && known->second.header.frame_id == one.header.frame_id)) {
        continue;
      }
      throw std::runtime_error(path + ": its /tf_static has '" + one.child_frame_id +
                               "' at two places; which one is meant cannot be known");
    }
  }
  if (found.empty()) throw std::runtime_error(path + ": has no /tf_static");
  tf2_msgs::TFMessage all;
  for (auto& one : found) all.transforms.push_back(std::move(one.second));
  return all;
}

TransformWindow::TransformWindow(const OpenBags& bags, TransformFeed& feed, const tf2_msgs::TFMessage& lent)
    : feed_(feed),
      view_(bags, {"/tf"}),
      statics_(bags, {"/tf_static"}),
      next_(view_.begin()),
      next_static_(statics_.begin()) {
  std::set<std::string> known;
  for (const rosbag::MessageInstance& m : statics_) {
    const auto tf = read(m);
    if (!tf) continue;
    tf2_msgs::TFMessage firsts;
    for (const auto& transform : tf->transforms) {
      if (known.insert(transform.child_frame_id).second) firsts.transforms.push_back(transform);
    }
    feed_.add(firsts, true);
  }
  tf2_msgs::TFMessage others;
  for (const auto& transform : lent.transforms) {
    if (known.count(transform.child_frame_id) == 0) others.transforms.push_back(transform);
  }
  feed_.add(others, true);
}

tf2_msgs::TFMessage::ConstPtr TransformWindow::read(const rosbag::MessageInstance& message) {
  if (!message.isType<tf2_msgs::TFMessage>()) return nullptr;
  return feed_.read(message.getTopic(), bytesOf(message));
}

ros::Duration TransformWindow::length() { return TF_KEPT + TF_AHEAD; }

void TransformWindow::meshComes(std::size_t body, StampNs stamp_ns, const ros::Time& at) {
  if (stamp_ns == 0) return;
  const auto [newest, first] = newest_mesh_.try_emplace(body, stamp_ns);
  if (!first && stamp_ns < newest->second) {
    meshes_went_back_ = at;
    newest_mesh_.clear();
    newest_mesh_[body] = stamp_ns;
  } else {
    newest->second = std::max(newest->second, stamp_ns);
  }
}

void TransformWindow::feedUntil(const ros::Time& at) {
  for (; next_static_ != statics_.end() && next_static_->getTime() <= at; ++next_static_) {
    if (const auto tf = read(*next_static_)) feed_.add(*tf, true);
  }
  for (; next_ != view_.end() && next_->getTime() <= at + TF_AHEAD; ++next_) {
    if (!waiting_) waiting_ = read(*next_);
    // Where the meshes never go back, its turn comes all the same.
    const ros::Time recorded = next_->getTime();
    const bool due = recorded + SEAM <= at || (meshes_went_back_ && recorded <= *meshes_went_back_ + SEAM);
    if (waiting_ && feed_.clears(*waiting_, false, next_->getCallerId()) && !due) return;
    if (waiting_) feed_.add(*waiting_, false, next_->getCallerId(), static_cast<StampNs>(recorded.toNSec()));
    waiting_.reset();
  }
}

}  // namespace dccd
