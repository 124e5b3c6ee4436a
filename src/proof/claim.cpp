#include <algorithm>
#include <sstream>

#include "dccd/outcome.h"

namespace dccd {
namespace {

constexpr std::size_t MOST_GAPS = 16;

enum Of : std::uint8_t { BODY, WHOLE };
enum By : std::uint8_t { STEP, CELL };
struct QuestionFacts {
  Of of;
  By by;
  const char* words;
};
#define DCCD_QUESTION_FACTS(QUESTION, OF, BY, words) {OF, BY, words},
constexpr QuestionFacts FACTS[] = {DCCD_QUESTIONS(DCCD_QUESTION_FACTS)};
#undef DCCD_QUESTION_FACTS
constexpr std::size_t COUNT = static_cast<std::size_t>(Question::COUNT);
static_assert(COUNT <= 32, "a bit a question");

const QuestionFacts& factsOf(Question question) { return FACTS[static_cast<std::size_t>(question)]; }
constexpr std::uint32_t bitOf(std::size_t question) { return std::uint32_t{1} << question; }

std::string nameOf(std::size_t body, const std::vector<Body>& bodies) {
  if (body == OBSTACLE_BODY) return "the map";
  return "'" + (body < bodies.size() ? bodies[body].name : std::to_string(body)) + "'";
}

std::string inWords(const Gap& gap, const std::vector<Body>& bodies) {
  std::ostringstream text;
  if (gap.at_start) {
    text << "nobody looked whether surfaces cross at " << gap.from << " of the step";
  } else {
    const bool is_itself = gap.body[0] == gap.body[1];
    text << "nobody looked whether " << nameOf(gap.body[0], bodies) << " touches "
         << (is_itself ? "itself" : nameOf(gap.body[1], bodies)) << " from " << gap.from << " to " << gap.to
         << " of the step";
  }
  return text.str();
}

}  // namespace

void Claim::ask(std::size_t bodies) { answered_.assign(bodies + 1, 0); }

void Claim::answer(Question question, const std::string& why_not, std::size_t body) {
  const std::size_t row = factsOf(question).of == BODY ? body : answered_.size() - 1;
  answered_.at(row) |= bitOf(static_cast<std::size_t>(question));
  if (!why_not.empty()) denied_.push_back({question, why_not});
}

void Claim::answer(Question question, const std::vector<std::string>& why_not) {
  answer(question, std::string());
  for (const std::string& why : why_not) answer(question, why);
}

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

Claim Claim::thatWasSaid(const std::vector<std::string>& missing) {
  Claim claim;
  claim.ask(0);
  claim.answered_[0] = claim.asked(false);
  claim.add(0, 1, {});
  for (const std::string& why : missing) claim.answer(Question::CONTENTS, why);
  return claim;
}

/// Of each body, or of all else.
std::uint32_t Claim::asked(bool of_body) const {
  std::uint32_t bits = 0;
  for (std::size_t q = 0; q < COUNT; ++q) {
    if ((FACTS[q].of == BODY) == of_body && (of_cell_ || FACTS[q].by == STEP)) bits |= bitOf(q);
  }
  return bits;
}

bool Claim::isAnswered() const {
  if (answered_.empty()) return false;
  const std::uint32_t of_body = asked(true), of_others = asked(false);
  return (answered_.back() & of_others) == of_others &&
         std::all_of(answered_.begin(), answered_.end() - 1,
                     [&](std::uint32_t answers) { return (answers & of_body) == of_body; });
}

bool Claim::holds() const { return isAnswered() && denied_.empty() && isCovered(); }

bool Claim::holdsButForTime() const {
  const auto isForTime = [](const Denied& one) { return one.question == Question::TIME; };
  return isAnswered() && std::all_of(denied_.begin(), denied_.end(), isForTime) && (!denied_.empty() || isCovered());
}

std::vector<std::string> Claim::missing(const std::vector<Body>& bodies) const {
  std::vector<std::string> sentences;
  bool was_time = true;
  for (const Denied& one : denied_) {
    sentences.push_back(one.why);
    was_time = was_time && one.question != Question::TIME;
  }
  // What there was no time for is gaps, of which the answer to that question has told.
  for (std::size_t g = 0; was_time && g < gaps_.size(); ++g) sentences.push_back(inWords(gaps_[g], bodies));
  for (std::size_t row = 0; row < answered_.size(); ++row) {
    const bool of_body = row + 1 < answered_.size();
    const std::uint32_t open = asked(of_body) & ~answered_[row];
    for (std::size_t q = 0; q < COUNT; ++q) {
      if ((open & bitOf(q)) == 0) continue;
      std::string words = FACTS[q].words;
      if (of_body) words.replace(words.find('%'), 1, nameOf(row, bodies));
      sentences.push_back("nobody looked " + words);
    }
  }
  if (sentences.empty() && !holds()) sentences.push_back("nobody looked at all of the step");
  return sentences;
}

}  // namespace dccd
