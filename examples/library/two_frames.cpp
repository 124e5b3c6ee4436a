// The core as a library, without ROS: two frames of a mesh in, the contacts between them out.
#include <cstdio>
#include <memory>

#include <dccd/detector.h>

using namespace dccd;

int main() {
  // A strip of cloth, 2 x 6 points, whose last points fold over and through its first ones.
  const auto topology = std::make_shared<const Topology>(Topology::grid(2, 6));
  Positions t0, t1;
  for (int row = 0; row < 2; ++row) {
    for (int col = 0; col < 6; ++col) {
      t0.emplace_back(0.1 * col, 0.1 * row, 0.0);
      t1.push_back(t0.back());
    }
    t0[6 * row + 4] = Vec3(0.32, 0.1 * row + 0.02, 0.1);
    t0[6 * row + 5] = Vec3(0.22, 0.1 * row + 0.02, 0.1);
    t1[6 * row + 4] = Vec3(0.32, 0.1 * row + 0.02, 0.05);
    t1[6 * row + 5] = Vec3(0.22, 0.1 * row + 0.02, -0.1);
  }

  DetectorOptions options;  // exact, one thread
  Detector detector(options);
  BodySetup cloth;
  cloth.name = "cloth";
  cloth.topology = topology;
  detector.setBodies({cloth}, {&t0});

  MotionStep step;
  step.bodies.push_back({&t0, &t1});
  const StepResult& result = detector.run(step);
  for (const Contact& c : result.contacts) {
    std::printf("%s %u %u %u %u  at %.9f\n", c.kind == PairKind::VERTEX_FACE ? "VF" : "EE", c.vertex[0], c.vertex[1],
                c.vertex[2], c.vertex[3], c.toc_lower);
  }
  std::printf("%zu contacts, starts %s\n", result.contacts.size(), toString(result.start_state));
  return 0;
}
