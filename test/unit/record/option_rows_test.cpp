// Every option is a row: two that differ in one are not the same, and a recording brings back those that it has.
#include <gtest/gtest.h>

#include "record/step_recording.h"
#include "step/option_rows.h"
#include "support/recordings.h"
#include "unit/record/recording_support.h"

namespace dccd {
namespace test {
namespace {

void change(bool& value) { value = !value; }
void change(int& value) { ++value; }
void change(double& value) { value += 0.5; }
void change(std::size_t& value) { value = value > 0 ? value - 1 : 7; }
void change(Accuracy& value) { value = Accuracy::CONSERVATIVE; }
void change(std::vector<Box>& value) { value.push_back({Vec3(1, 2, 3), Vec3(4, 5, 6)}); }
void change(std::vector<Expectation>& value) { value.push_back({{{{0, {1, 2}, "hem"}, {1, {}, ""}}}, "carry"}); }
void change(std::vector<std::string>& value) { value.push_back("a body"); }

template <bool RECORDED, class Value>
constexpr bool isRecorded(const OptionRow<RECORDED, Value>&) {
  return RECORDED;
}

template <std::size_t I>
void expectRow(const StepRecording& plain) {
  SCOPED_TRACE("row " + std::to_string(I));
  StepRecording changed = plain;
  auto rows = optionRows(changed.options);
  change(std::get<I>(rows).value);
  EXPECT_FALSE(changed.options == plain.options);
  EXPECT_TRUE(again(changed).options == (isRecorded(std::get<I>(rows)) ? changed : plain).options);
}

template <std::size_t... I>
void expectRows(const StepRecording& plain, std::index_sequence<I...>) {
  (expectRow<I>(plain), ...);
}

TEST(OptionRows, EachIsComparedAndTheRecordedOnesComeBack) {
  StepRecording plain = recordScene();
  plain.options = Options();
  using Rows = decltype(optionRows(plain.options));
  EXPECT_GE(std::tuple_size_v<Rows>, 22u);
  expectRows(plain, std::make_index_sequence<std::tuple_size_v<Rows>>());
}

}  // namespace
}  // namespace test
}  // namespace dccd
