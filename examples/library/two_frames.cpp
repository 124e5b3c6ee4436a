// The core as a library, without ROS: two frames of a mesh in, the contacts between them out.
#include <cstdio>

#include <dccd/detect.h>

using namespace dccd;

int main() {
  // A strip of cloth, 2 x 6 points, whose last points fold over and through its first ones.
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

  Step step;
  step.bodies.resize(1);
  step.bodies[0].name = "cloth";
  step.bodies[0].topology = share(Topology::grid(2, 6));
  step.bodies[0].t0 = share(t0);
  step.bodies[0].t1 = share(t1);
  History history;  // of this stream of steps; a step that begins where the last one ended goes on from there
  const Outcome outcome = detect(step, Options(), history);
  for (const Contact& c : outcome.contacts) {
    std::printf("%s %u %u %u %u  at %.9f\n", c.kind == PairKind::VERTEX_FACE ? "VF" : "EE", c.vertex[0], c.vertex[1],
                c.vertex[2], c.vertex[3], c.toc_lower);
  }
  std::printf("%zu contacts, starts %s\n", outcome.contacts.size(), toString(outcome.start_state));
  return 0;
}
