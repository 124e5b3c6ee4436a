// A step of at most twelve triangles made from the bytes, through the clustered detector and by brute force, judged by
// the oracle; then the step after it, with the start state carried over.
#include <stdexcept>
#include <string>

#include "fuzz/fuzz_target.h"
#include "support/step_judge.h"

namespace {

/// Integers from bytes; the lower end of the range when there are none left, so that short inputs are simple steps.
class NumbersOfBytes {
 public:
  NumbersOfBytes(const std::uint8_t* data, std::size_t size) : data_(data), end_(data + size) {}
  int operator()(int low, int high) {
    const std::uint32_t range = static_cast<std::uint32_t>(high - low);
    std::uint32_t value = 0;
    for (std::uint32_t rest = range; rest != 0 && data_ != end_; rest >>= 8) value = value << 8 | *data_++;
    return low + static_cast<int>(value % (range + 1));
  }

 private:
  const std::uint8_t *data_, *end_;
};

void mesh_step(const std::uint8_t* data, std::size_t size) {
  using namespace dccd::test;
  NumbersOfBytes bytes(data, size);
  const Draw draw = [&bytes](int low, int high) { return bytes(low, high); };
  // Small integers and few bits: degenerate in every way, and quick for the oracle.
  const Coordinates coordinates = draw(0, 1) == 0 ? Coordinates::SMALL_INTEGERS : Coordinates::FEW_BITS;
  const TestStep step = randomStep(draw, draw(1, 12), coordinates);
  std::string wrong = judgeStep(step);
  if (!wrong.empty()) throw std::logic_error(wrong);
  std::vector<dccd::Positions> t1;
  for (const StepBody& body : step.bodies) t1.push_back(randomMotion(draw, body.t1, coordinates));
  int carried = 0, full = 0;
  wrong = judgeSequence({step, step.continued(t1)}, carried, full);
  if (!wrong.empty()) throw std::logic_error(wrong);
}

}  // namespace

DEFORMABLE_CCD_FUZZ_TARGET(mesh_step)
