#include "node/bag_pieces.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <regex>
#include <set>

#include "node/bag_reading.h"

namespace dccd {
namespace {

namespace fs = std::filesystem;

/// The recorder goes on while it begins a new file, so that nothing but the time between two messages passes. Where the
/// name has a date, nobody gave it by hand: then all may have been silent for longer.
constexpr double PAUSE_S = 1, PAUSE_OF_DATED_S = 10;

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

/// Whether the second bag goes on where the first one ends.
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
  return first && second && goesOn(*first, *second, false);
}

std::string fileName(const std::string& bag) { return fs::path(bag).filename().string(); }

}  // namespace

std::vector<std::vector<std::string>> groupedByRun(const std::vector<std::string>& bags) {
  struct Piece {
    std::size_t place;
    PieceName name;
    BagSpan span;
  };
  std::map<std::string, std::vector<Piece>> runs;
  std::map<std::size_t, std::vector<std::size_t>> groups;  // by the place of the first piece
  for (std::size_t i = 0; i < bags.size(); ++i) {
    const std::optional<PieceName> name = pieceNameOf(bags[i]);
    const std::optional<BagSpan> span = name ? spanOf(bags[i]) : std::nullopt;
    if (span) {
      runs[name->run + (name->dated ? "/" : "")].push_back({i, *name, *span});
    } else {
      groups[i] = {i};
    }
  }
  for (auto& [run, pieces] : runs) {
    std::stable_sort(pieces.begin(), pieces.end(),
                     [](const Piece& a, const Piece& b) { return a.span.begin < b.span.begin; });
    std::vector<bool> taken(pieces.size());
    for (std::size_t first = 0; first < pieces.size(); ++first) {
      if (taken[first]) continue;
      std::vector<std::size_t>& group = groups[pieces[first].place];
      group = {pieces[first].place};
      std::size_t last = first;
      for (std::size_t next = first + 1; next < pieces.size(); ++next) {
        if (taken[next] || pieces[next].name.number != pieces[last].name.number + 1 ||
            !goesOn(pieces[last].span, pieces[next].span, pieces[next].name.dated)) {
          continue;
        }
        taken[next] = true;
        group.push_back(pieces[next].place);
        last = next;
      }
    }
  }
  std::map<std::size_t, std::vector<std::string>> in_order;
  for (const auto& [first, places] : groups) {
    std::vector<std::string>& group = in_order[*std::min_element(places.begin(), places.end())];
    for (const std::size_t place : places) group.push_back(bags[place]);
  }
  std::vector<std::vector<std::string>> result;
  for (auto& [place, group] : in_order) result.push_back(std::move(group));
  return result;
}

std::vector<std::string> missingPieces(const std::vector<std::string>& bags, bool lacks_something) {
  struct Piece {
    std::string bag;
    PieceName name;
  };
  std::map<std::string, std::map<unsigned long, Piece>> runs;
  for (const std::string& bag : bags) {
    if (const std::optional<PieceName> name = pieceNameOf(bag))
      runs[name->run].try_emplace(name->number, Piece{bag, *name});
  }
  std::vector<std::string> sentences;
  for (const auto& [run, pieces] : runs) {
    const Piece& first = pieces.begin()->second;
    const std::string name = fileName(first.bag);
    if (first.name.number > 0) {
      const bool is_known = first.name.dated || followsItsNeighbour(first.bag, first.name);
      if (is_known || lacks_something) {
        sentences.push_back(
            (is_known ? "this is a piece of a split recording (" : "this may be a piece of a split recording (") +
            name + "): give the first one, too, which alone has /tf_static and latched maps");
      }
    }
    const Piece* before = nullptr;
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

}  // namespace dccd
