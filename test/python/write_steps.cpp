// write_steps FOLDER SEED COUNT: random steps as recordings with their answers, which test/package/python_test.py holds
// those of the Python module against.
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <random>

#include "record/step_recording.h"
#include "support/step_support.h"

namespace {

using namespace dccd;

Options randomOptions(const test::Draw& draw) {
  Options options;
  const int bits[] = {10, 32, 52};
  options.accuracy.toc_bits = bits[draw(0, 2)];
  options.accuracy.rung = draw(0, 3) == 0 ? Accuracy::CONSERVATIVE : Accuracy::EXACT;
  options.accuracy.tolerance_m = 1e-3;
  options.accuracy.max_subdivisions = 256;
  options.earliest_only = draw(0, 4) == 0;
  options.patches = !options.earliest_only;
  if (draw(0, 3) == 0) options.max_contacts = 5;
  if (draw(0, 3) == 0) options.exclude_boxes = {Box{{0, 0, 0}, {2, 1, 3}}};
  if (draw(0, 3) == 0 && !options.earliest_only) options.expected = {{{{{0, {0, 1}, ""}, {0, {}, ""}}}, ""}};
  return options;
}

ObstacleMap randomMap(const test::Draw& draw) {
  ObstacleMap map;
  if (draw(0, 1) == 0) return map;
  std::vector<OccupiedLeaf> leaves;
  for (std::uint16_t x = 32764; x < 32772; x += 2) {
    for (std::uint16_t y = 32764; y < 32772; y += 2) {
      if (draw(0, 3) == 0) leaves.push_back({{x, y, static_cast<std::uint16_t>(32764 + 2 * draw(0, 3))}, 2});
    }
  }
  map.surface = VoxelSurface::build(0.5, leaves);
  map.map_from_fixed.translation() = Vec3(0.25 * draw(-2, 2), 0, 0);
  return map;
}

StepRecording randomRecording(std::uint64_t seed) {
  const test::Draw draw = test::drawFrom(seed);
  StepRecording recording;
  recording.note = "random";
  recording.step = test::randomStep(draw, 12).motion();
  recording.step.stamp_ns = 1;
  recording.step.map = randomMap(draw);
  recording.options = randomOptions(draw);
  if (recording.options.accuracy.rung == Accuracy::CONSERVATIVE) {
    std::vector<Body>& bodies = recording.step.bodies;
    bodies[0].minimum_separation_m = 0.125 * draw(0, 3);
    bodies[0].separations = {{static_cast<std::uint16_t>(bodies.size() - 1), 0.0625}, {OBSTACLE_BODY, 0.03125}};
    bodies[0].radius_m = share(std::vector<double>(bodies[0].t0->size(), 0.015625));
  }
  History history;
  recording.answer = detect(recording.step, recording.options, history);
  recording.has_answer = true;
  return recording;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return std::fputs("usage: write_steps FOLDER SEED COUNT\n", stderr), 2;
  try {
    const std::uint64_t seed = std::strtoull(argv[2], nullptr, 10), count = std::strtoull(argv[3], nullptr, 10);
    for (std::uint64_t i = seed; i < seed + count; ++i) {
      writeRecording(argv[1] + ("/" + std::to_string(i)) + ".step", randomRecording(i));
    }
    return 0;
  } catch (const std::exception& error) {
    return std::fprintf(stderr, "write_steps: %s\n", error.what()), 1;
  }
}
