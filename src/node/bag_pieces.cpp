#include "node/bag_pieces.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <regex>
#include <stdexcept>
#include <utility>

namespace dccd {
namespace {

namespace fs = std::filesystem;

/// The recorder goes on while it begins a new file, so that nothing but the time between two messages passes. Where the
/// name has a date, nobody gave it by hand: then all may have been silent for longer.
constexpr double PAUSE_S = 1, PAUSE_OF_DATED_S = 10;
/// A longer pause than this between two bags is told.
constexpr double LONG_PAUSE_S = 10;

/// RUN_2026-01-31-12-00-00_3.bag, or RUN_3.bag: the recorder appends date, if it was not given a name, and number.
struct PieceName {
  std::string run;  ///< the folder, and the name without date and number
  unsigned long number = 0;
  bool dated = false;
};

std::optional<PieceName> pieceNameOf(const std::string& bag) {
  static const std::regex NUMBERED("(.*)_(0|[1-9][0-9]{0,8})"), DATED("(|.*_)[0-9]{4}(-[0-9]{2}){5}");
  const fs::path path = fs::absolute(bag).lexically_normal();
  const std::string stem = path.stem().string();
  std::smatch parts, of_run;
  if (path.extension() != ".bag" || !std::regex_match(stem, parts, NUMBERED)) return std::nullopt;
  PieceName name;
  name.run = parts[1];
  name.number = std::stoul(parts[2]);
  name.dated = std::regex_match(name.run, of_run, DATED);
  if (name.dated) name.run = std::string(of_run[1]) + "DATE";
  name.run = (path.parent_path() / name.run).string();
  return name;
}

/// Whether the second bag goes on where the first one ends, both with messages.
bool goesOn(const BagSpan& first, const BagSpan& second, bool dated) {
  const double pause_s = (second.begin - first.end).toSec();
  return pause_s >= -OUT_OF_ORDER_S && pause_s <= (dated ? PAUSE_OF_DATED_S : PAUSE_S);
}

/// The piece before, of a name without a date, lies in the same folder.
bool followsItsNeighbour(const std::string& bag, const PieceName& name) {
  const fs::path path(bag);
  std::string stem = path.stem().string();
  stem.resize(stem.rfind('_') + 1);
  const fs::path before = path.parent_path() / (stem + std::to_string(name.number - 1) + ".bag");
  const std::optional<BagSpan> first = spanOf(before.string()), second = spanOf(bag);
  return first && second && !first->isEmpty() && !second->isEmpty() && goesOn(*first, *second, false);
}

std::string fileName(const std::string& bag) { return fs::path(bag).filename().string(); }

struct Piece {
  std::size_t place;  // among what was given
  PieceName name;
  BagSpan span;
};

constexpr double UNRELATED_S = std::numeric_limits<double>::infinity();

/// Pieces that go on from each other.
struct Recording {
  std::vector<std::size_t> places;
  unsigned long last_number = 0;
  BagSpan span;  // of that one

  void add(const Piece& piece) {
    places.push_back(piece.place);
    last_number = piece.name.number;
    span = piece.span;
  }
  /// UNRELATED_S: the piece does not go on from here.
  double pauseBefore(const Piece& piece) const {
    if (piece.name.number != last_number + 1) return UNRELATED_S;
    return goesOn(span, piece.span, piece.name.dated) ? (piece.span.begin - span.end).toSec() : UNRELATED_S;
  }
};

}  // namespace

std::vector<std::vector<std::string>> groupedByRun(const std::vector<std::string>& bags) {
  std::map<std::string, std::vector<Piece>> of_name;
  std::vector<std::vector<std::size_t>> groups;
  for (std::size_t i = 0; i < bags.size(); ++i) {
    const std::optional<PieceName> name = pieceNameOf(bags[i]);
    const std::optional<BagSpan> span = name ? spanOf(bags[i]) : std::nullopt;
    if (span && !span->isEmpty()) {
      of_name[name->run].push_back({i, *name, *span});
    } else {
      groups.push_back({i});
    }
  }
  for (auto& [name, pieces] : of_name) {
    // Of equal numbers, which are of several recordings, the earlier one first.
    std::stable_sort(pieces.begin(), pieces.end(), [](const Piece& a, const Piece& b) {
      return std::pair(a.name.number, a.span.begin) < std::pair(b.name.number, b.span.begin);
    });
    std::vector<Recording> recordings;
    for (const Piece& piece : pieces) {
      const auto nearest = std::min_element(
          recordings.begin(), recordings.end(),
          [&](const Recording& a, const Recording& b) { return a.pauseBefore(piece) < b.pauseBefore(piece); });
      if (nearest == recordings.end() || nearest->pauseBefore(piece) == UNRELATED_S) {
        recordings.emplace_back().add(piece);
      } else {
        nearest->add(piece);
      }
    }
    for (Recording& recording : recordings) groups.push_back(std::move(recording.places));
  }
  std::sort(groups.begin(), groups.end(), [](const auto& a, const auto& b) {
    return *std::min_element(a.begin(), a.end()) < *std::min_element(b.begin(), b.end());
  });
  std::vector<std::vector<std::string>> result;
  for (const std::vector<std::size_t>& group : groups) {
    result.emplace_back();
    for (const std::size_t place : group) result.back().push_back(bags[place]);
  }
  return result;
}

std::vector<std::string> missingPieces(const std::vector<std::string>& bags, bool lacks_something) {
  struct Named {
    std::string bag;
    PieceName name;
  };
  std::map<std::string, std::map<unsigned long, Named>> runs;
  for (const std::string& bag : bags) {
    if (const std::optional<PieceName> name = pieceNameOf(bag))
      runs[name->run].try_emplace(name->number, Named{bag, *name});
  }
  std::vector<std::string> sentences;
  for (const auto& [run, pieces] : runs) {
    const Named& first = pieces.begin()->second;
    const std::string name = fileName(first.bag);
    if (first.name.number > 0) {
      const bool is_known = first.name.dated || followsItsNeighbour(first.bag, first.name);
      if (is_known || lacks_something) {
        sentences.push_back(
            (is_known ? "this is a piece of a split recording (" : "this may be a piece of a split recording (") +
            name + "): give the first one, too, which alone has /tf_static and latched maps");
      }
    }
    const Named* before = nullptr;
    for (const auto& [number, piece] : pieces) {
      if (before && number != before->name.number + 1) {
        sentences.push_back("between " + fileName(before->bag) + " and " + fileName(piece.bag) +
                            " pieces of the split recording are missing");
      }
      before = &piece;
    }
  }
  return sentences;
}

std::vector<std::string> pausesOfOneRun(const OpenBags& bags, const std::vector<std::string>& mesh_topics) {
  const std::vector<std::string>& paths = bags.paths();
  std::vector<std::string> pauses;
  for (std::size_t i = 1; i < paths.size(); ++i) {
    const std::optional<BagSpan> before = spanOf(paths[i - 1]), next = spanOf(paths[i]);
    if (!before || !next || before->isEmpty() || next->isEmpty()) continue;
    if (const double pause_s = (next->begin - before->end).toSec(); pause_s > LONG_PAUSE_S) {
      pauses.push_back("nothing was recorded for " + std::to_string(std::lround(pause_s)) + " s between " +
                       paths[i - 1] + " and " + paths[i]);
    }
  }
  for (const std::string& topic : mesh_topics) {
    std::optional<std::pair<std::size_t, ros::Time>> last;  // the bag with the latest end
    for (std::size_t i = 0; i < paths.size(); ++i) {
      rosbag::View view(bags.bag(i), rosbag::TopicQuery(topic));
      if (view.size() == 0) continue;
      const ros::Time begin = view.getBeginTime(), end = view.getEndTime();
      if (last && begin < last->second - ros::Duration(OUT_OF_ORDER_S)) {
        throw std::runtime_error(paths[last->first] + " and " + paths[i] + " have " + topic +
                                 " at the same time: they are no pieces of one run; analyse each by itself");
      }
      if (!last || end > last->second) last.emplace(i, end);
    }
  }
  return pauses;
}

}  // namespace dccd
