// Whether the markers of a topic's messages are of one thing: a tracker may draw several on one topic.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "input/mesh_views.h"

namespace dccd {

/// For messages.
std::string nameOf(std::string_view ns, std::int32_t id);
std::string nameOf(const MarkerView& marker);

/// Of the markers that were taken for the mesh, from message to message. A Marker alone may be numbered anew each time:
/// an id that comes back after another one is another marker's.
class MarkerNames {
 public:
  /// Throws WireError with both names where these are not those of the message before; from then on always, until
  /// forget(): nobody knows which of the two is the mesh.
  void require(const std::vector<const MarkerView*>& taken);
  /// That message is a frame.
  void keep(const std::vector<const MarkerView*>& taken);
  /// Whether a message was a frame, and this marker is none of its things.
  bool isOther(const MarkerView& marker) const;
  void forget() { *this = MarkerNames(); }

 private:
  std::vector<std::string> namespaces_;  // ascending
  std::string example_;                  // a name of the message before
  bool is_alone_ = false;                // it was a message of one marker
  std::int32_t id_ = 0;
  std::deque<std::int32_t> ids_before_;  // those before it
  std::string conflict_;

  bool has(const MarkerView& marker) const;
};

/// Markers that came before: each is shown until it is deleted, replaced by its name, or its lifetime is over.
class ShownMarkers {
 public:
  /// Those that came before the message and are shown still, beside it.
  struct Left {
    std::size_t count = 0;
    std::string example;
  };
  /// A stream may give all of its markers other names each time, and then it shows what it names last. That is believed
  /// from the second time on.
  explicit ShownMarkers(bool may_rename) : may_rename_(may_rename) {}
  /// What the message takes away.
  void remove(const std::vector<MarkerView>& markers);
  /// The message shows these.
  Left show(const std::vector<const MarkerView*>& markers);
  void forget() {
    shown_.clear();
    renames_ = false;
  }

 private:
  using Name = std::pair<std::string, std::int32_t>;
  struct Shown {
    StampNs until_ns = 0;
    bool is_new = false, is_renamed = false;  ///< of this message; what came after it bore other names alone
  };
  bool may_rename_, renames_ = false;
  std::map<Name, Shown> shown_;
};

}  // namespace dccd
