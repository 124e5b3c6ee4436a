// cut_margins: cuts each margin of tolerances.h in turn and shows that a test fails then.
//   cut_margins [SCALE]               a table: the margin, what is wrong at a tenth, and the largest part that is
//   wrong;
//                                     SCALE times as many inputs as in the tests
//   cut_margins --search NAME SECONDS inputs that go wrong with as little cut off as can be found, for witnesses.txt
// The core must be built with -DDEFORMABLE_CCD_VARIABLE_MARGINS=ON. Exit status: 1 where no test holds a margin.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "dccd/tolerances.h"
#include "simd/float_mode.h"
#include "support/margin_checks.h"
#include "support/margin_witnesses.h"
#include "support/query_property.h"

namespace dccd {
namespace test {
namespace {

/// Sets a margin to a part of its value.
using Cut = std::function<void(double part)>;

template <class Number>
Cut cutOf(Number& margin) {
  return [&margin, whole = margin](double part) { margin = static_cast<Number>(part * static_cast<double>(whole)); };
}

#define MARGIN(name) \
  { #name, cutOf(tolerance::name) }
const std::map<std::string, Cut>& cuts() {
  static const std::map<std::string, Cut> all = {
      MARGIN(BATCH_VALUE),     MARGIN(BATCH_MINOR),        MARGIN(BATCH_SEPARATION),    MARGIN(SIMPLE_TIME),
      MARGIN(INSIDE_MINOR),    MARGIN(QUADRATIC_SIGN),     MARGIN(CUBIC_VALUE),         MARGIN(CUBIC_VALUE_PAIRS),
      MARGIN(CUBIC_SLOPE),     MARGIN(ADVANCE_SEPARATION), MARGIN(ADVANCE_POINT),       MARGIN(FUSED_CUBIC),
      MARGIN(FUSED_PLANAR),    MARGIN(SEGMENT_LINE),       MARGIN(SEGMENT_PLANE),       MARGIN(SEGMENT_PROJECTED),
      MARGIN(ORIENTATION_2D),  MARGIN(ORIENTATION_3D),     MARGIN(CROSSING_TIME),       MARGIN(SIDE),
      MARGIN(VOXEL_KEY),       MARGIN(MAP_BOUND),          MARGIN(SEPARATION_SUM),      MARGIN(TOC_BOUND),
      MARGIN(FUSED_UNDERFLOW), MARGIN(SEGMENT_UNDERFLOW),  MARGIN(UNFOLDED_COORDINATE),
  };
  return all;
}
#undef MARGIN

/// Parts of a margin at which inputs are looked at.
constexpr double PARTS[] = {1,   0.7,  0.5,  0.4,  0.32, 0.25, 0.2,  0.16, 0.13,
                            0.1, 0.07, 0.05, 0.03, 0.02, 0.01, 1e-3, 1e-6, 0};
constexpr int TENTH = 9, COUNT = sizeof PARTS / sizeof *PARTS;

bool isWrongAt(const Cut& cut, const IsWrong& is_wrong, int part) {
  cut(PARTS[part]);
  const bool wrong = is_wrong();
  cut(1);
  return wrong;
}

/// The first of PARTS at which the answer is wrong, taking it for wrong from there on; COUNT for none.
int firstWrong(const Cut& cut, const IsWrong& is_wrong) {
  if (!isWrongAt(cut, is_wrong, COUNT - 1)) return COUNT;
  int right = -1, wrong = COUNT - 1;
  while (wrong - right > 1) {
    const int middle = (right + wrong) / 2;
    (isWrongAt(cut, is_wrong, middle) ? wrong : right) = middle;
  }
  return wrong;
}

const MarginCheck& checkOf(const std::string& margin) {
  for (const MarginCheck& check : marginChecks()) {
    if (check.margin == margin) return check;
  }
  throw std::invalid_argument("no check holds the margin " + margin);
}

int search(const std::string& margin, double seconds, std::uint64_t seed) {
  const MarginCheck& check = checkOf(margin);
  const Cut& cut = cuts().at(margin);
  RandomSource random(seed);
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  MarginInput best;
  int best_part = COUNT;
  long made = 0, judged = 0;
  while (std::chrono::steady_clock::now() < end) {
    MarginInput input = check.make(random);
    ++made;
    int part = firstWrong(cut, check.judge(input));
    if (part == COUNT) continue;
    for (int failures = 0; failures < 300 && std::chrono::steady_clock::now() < end; ++failures) {
      MarginInput other = input;
      for (auto i = 1 + random() % 3; i > 0; --i) check.change(other, random);
      ++judged;
      const IsWrong is_wrong = check.judge(other);
      if (!isWrongAt(cut, is_wrong, part)) continue;
      const int other_part = firstWrong(cut, is_wrong);
      if (other_part > part) continue;
      if (other_part < part) failures = 0;
      part = other_part;
      input = other;
    }
    if (part >= best_part) continue;
    best_part = part;
    best = input;
    std::fprintf(stderr, "%s: wrong at %g after %ld made, %ld changed\n", margin.c_str(), PARTS[part], made, judged);
  }
  if (best_part == COUNT) {
    std::fprintf(stderr, "%s: %ld made, none goes wrong\n", margin.c_str(), made);
    return 1;
  }
  std::printf("%s\n", witnessLine(margin, best).c_str());
  return 0;
}

/// The table. `scale` times as many inputs are made as in each run of the tests.
int table(double scale) {
  int not_held = 0;
  std::printf("| margin | inputs | wrong at a tenth | largest part that is wrong |\n|---|--:|--:|--:|\n");
  for (const auto& [margin, cut] : cuts()) {
    const MarginCheck& check = checkOf(margin);
    std::vector<MarginInput> inputs = marginWitnesses(margin);
    RandomSource random(propertySeed());
    for (int i = 0; i < static_cast<int>(scale * check.inputs); ++i) inputs.push_back(check.make(random));
    int wrong = 0, first = COUNT;
    for (const MarginInput& input : inputs) {
      const IsWrong is_wrong = check.judge(input);
      wrong += isWrongAt(cut, is_wrong, TENTH);
      if (first > 0 && isWrongAt(cut, is_wrong, first - 1)) first = firstWrong(cut, is_wrong);
      if (first == COUNT) first = firstWrong(cut, is_wrong);
    }
    not_held += first == 0 || first == COUNT || PARTS[first] < check.held_at;
    char part[20];
    std::snprintf(part, sizeof part, "%g", first == COUNT ? NAN : PARTS[first]);
    std::printf("| `%s` | %zu | %d | %s |\n", margin.c_str(), inputs.size(), wrong, first == COUNT ? "none" : part);
    std::fflush(stdout);
  }
  return not_held != 0;
}

int run(int argc, char** argv) {
  const ScopedFloatMode mode;
  if (argc > 3 && std::strcmp(argv[1], "--search") == 0) {
    return search(argv[2], std::atof(argv[3]), argc > 4 ? std::strtoull(argv[4], nullptr, 10) : propertySeed());
  }
  return table(argc > 1 ? std::atof(argv[1]) : 1);
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) {
  try {
    return dccd::test::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cut_margins: %s\n", error.what());
    return 2;
  }
}
