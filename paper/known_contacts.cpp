#include "paper/known_contacts.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "base/decimal.h"
#include "base/regular_file.h"

namespace dccd {
namespace {

constexpr std::uint64_t MAX_TRUTH_BYTES = std::uint64_t{4} << 30;

/// Kind, vertices and the times that follow; none for a line without a contact.
struct Line {
  KnownContacts::Pair pair;
  std::optional<TimeCell> cell;
};

double timeOf(const std::string& word) {
  const auto time = decimalNumber(word);
  if (!time) throw std::runtime_error("a time of contact must be a number, not '" + word + "'");
  return *time;
}

/// What follows the times, as the certainty that check_step writes, is skipped.
std::optional<Line> parse(std::string text) {
  std::replace(text.begin(), text.end(), ',', ' ');
  std::istringstream in(text);
  std::string kind;
  if (!(in >> kind) || kind.front() == '#' || kind == "kind") return std::nullopt;
  if (kind != "VF" && kind != "EE") throw std::runtime_error("'" + kind + "' is neither VF nor EE");
  std::array<Index, 4> vertices{};
  std::string word;
  for (Index& vertex : vertices) {
    const auto number = in >> word ? decimalInteger(word) : std::nullopt;
    if (!number || *number < 0 || *number >= NO_INDEX) {
      throw std::runtime_error("four vertices are needed, numbered from 0");
    }
    vertex = static_cast<Index>(*number);
  }
  Line line{KnownContacts::pairOf(kind == "VF" ? PairKind::VERTEX_FACE : PairKind::EDGE_EDGE, vertices), std::nullopt};
  if (in >> word) {
    TimeCell cell{};
    cell.lower = timeOf(word);
    cell.upper = in >> word ? timeOf(word) : cell.lower;
    if (!(cell.lower >= 0 && cell.lower <= cell.upper && cell.upper <= 1)) {
      throw std::runtime_error("a time of contact lies between 0 and 1, the earlier end first");
    }
    line.cell = cell;
  }
  return line;
}

}  // namespace

double tocError(const TimeCell& found, const TimeCell& truth) {
  return std::max({std::abs(found.lower - truth.lower), std::abs(found.lower - truth.upper),
                   std::abs(found.upper - truth.lower), std::abs(found.upper - truth.upper)});
}

KnownContacts::Pair KnownContacts::pairOf(PairKind kind, std::array<Index, 4> v) {
  if (kind == PairKind::VERTEX_FACE) {
    std::sort(v.begin() + 1, v.end());
  } else {
    std::sort(v.begin(), v.begin() + 2);
    std::sort(v.begin() + 2, v.end());
    if (v[2] < v[0] || (v[2] == v[0] && v[3] < v[1])) v = {v[2], v[3], v[0], v[1]};
  }
  return {kind, v};
}

KnownContacts KnownContacts::fromFile(const std::string& path) {
  const std::string problem = regularFileProblem(path, MAX_TRUTH_BYTES);
  if (!problem.empty()) throw std::runtime_error(path + ": " + problem);
  std::ifstream in(path);
  if (!in) throw std::runtime_error(path + ": cannot be read");
  KnownContacts known;
  std::string text;
  for (std::size_t number = 1; std::getline(in, text); ++number) {
    try {
      if (const std::optional<Line> line = parse(text)) {
        std::optional<TimeCell>& cell = known.times_[line->pair];
        if (line->cell) cell = line->cell;  // a list of pairs and one of times may stand in one file
      }
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(path + ": line " + std::to_string(number) + ": " + error.what());
    }
  }
  if (known.times_.empty()) throw std::runtime_error(path + ": has no contact");
  return known;
}

KnownContacts KnownContacts::fromOutcome(const Outcome& outcome) {
  KnownContacts known;
  for (const Contact& contact : outcome.contacts) {
    known.times_[pairOf(contact.kind, contact.vertex)] = TimeCell{contact.toc_lower, contact.toc_upper};
  }
  return known;
}

std::optional<TimeCell> KnownContacts::timeOf(const Pair& pair) const {
  const auto found = times_.find(pair);
  return found == times_.end() ? std::nullopt : found->second;
}

AccuracyErrors errorsOf(const Outcome& outcome, const KnownContacts& truth, const KnownContacts& finest) {
  AccuracyErrors errors;
  std::size_t hit = 0;
  for (const Contact& contact : outcome.contacts) {
    const KnownContacts::Pair pair = KnownContacts::pairOf(contact.kind, contact.vertex);
    const bool is_true = truth.holds(pair), is_certain = contact.certainty == Certainty::CERTAIN;
    hit += is_true;
    errors.undecided += !is_certain;
    errors.false_contacts += is_certain && !is_true;
    if (!is_certain || !is_true) continue;
    std::optional<TimeCell> time = truth.timeOf(pair);
    errors.timed_by_truth += time.has_value();
    if (!time) time = finest.timeOf(pair);
    if (!time) continue;
    errors.toc_error = std::max(errors.toc_error, tocError({contact.toc_lower, contact.toc_upper}, *time));
  }
  errors.missed = truth.size() - hit;
  return errors;
}

MedianInterval medianOf(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const double n = static_cast<double>(values.size());
  const double half_width = 0.5 * 1.96 * std::sqrt(n);
  const auto rank = [&](double place) { return values[static_cast<std::size_t>(std::clamp(place, 0.0, n - 1))]; };
  const std::size_t middle = values.size() / 2;
  const double median = values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
  return {rank(std::floor((n - 1) / 2 - half_width)), median, rank(std::ceil((n - 1) / 2 + half_width))};
}

}  // namespace dccd
