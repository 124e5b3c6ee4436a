#include <algorithm>
#include <sstream>

#include "dccd/outcome.h"

namespace dccd {
namespace {

constexpr std::size_t MOST_GAPS = 16;

}  // namespace

void Claim::add(std::size_t part, std::size_t parts, const std::vector<Gap>& gaps) {
  const bool follows = part == 0 || (parts == parts_ && part == covered_);
  covered_ = follows ? part + 1 : 0;
  parts_ = parts;
  const auto count = static_cast<double>(parts);
  for (const Gap& gap : gaps) {
    if (gaps_.size() == MOST_GAPS) return;
    gaps_.push_back({gap.body, gap.at_start, static_cast<double>(part) / count, static_cast<double>(part + 1) / count});
  }
}

std::vector<std::string> Claim::inWords(const std::vector<std::string>& names) const {
  std::vector<std::string> sentences;
  const auto nameOf = [&](std::uint16_t body) {
    return body == OBSTACLE_BODY ? std::string("the map")
                                 : "'" + (body < names.size() ? names[body] : std::to_string(body)) + "'";
  };
  for (const Gap& gap : gaps_) {
    std::ostringstream text;
    text << "nobody looked whether ";
    if (gap.at_start) {
      text << "surfaces cross at " << gap.from << " of the step";
    } else {
      const bool is_itself = gap.body[0] == gap.body[1];
      text << nameOf(gap.body[0]) << " touches " << (is_itself ? "itself" : nameOf(gap.body[1])) << " from " << gap.from
           << " to " << gap.to << " of the step";
    }
    sentences.push_back(text.str());
  }
  if (sentences.empty() && !holds()) sentences.push_back("nobody looked at all of the step");
  return sentences;
}

}  // namespace dccd
