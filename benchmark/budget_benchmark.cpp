// How far a step runs over its budget on input that is made to be slow: what trackers send when they fail, what nobody
// sends but an attacker, and the largest steps that there are. What counts is the processor time of the thread from the
// end of the budget on: on an idle core the time by the clock, and on a busy one without that of the others.
#include <CLI/CLI.hpp>
#include <cstring>
#include <fstream>
#include <functional>
#include <iostream>
#include <nlohmann/json.hpp>
#include <random>

#include "dccd/voxel_surface.h"
#include "support/data.h"
#include "support/detector.h"
#include "support/scene_data.h"
#include "support/timing.h"

namespace dccd {
namespace benchmarks {
namespace {

constexpr double BUDGETS_MS[] = {1, 5, 10, 30};
constexpr double LONGEST_MS = 2000;  // for a step without a budget

/// Something that is done within a deadline, `round` of a stream; what it says is whether it was cut.
struct Attack {
  std::string name;
  std::function<bool(std::size_t round, const Deadline& deadline)> run;
};

/// The node's limits of what a step may find, with default parameters.
Options asInTheNode() {
  Options options;
  options.max_contacts = 10000;
  options.patches = true;
  options.max_found = (std::size_t{512} << 20) / 4 / tolerance::BYTES_PER_CONTACT;
  options.max_found_per_feature = tolerance::CONTACTS_PER_FEATURE;
  return options;
}

Body bodyOf(const std::string& name, Topology topology) {
  Body body;
  body.name = name;
  body.topology = std::make_shared<const Topology>(std::move(topology));
  return body;
}

/// A stream that goes from frame to frame, and from the last to the first.
Attack stream(const std::string& name, const std::vector<Body>& bodies,
              const std::vector<std::vector<Positions>>& frames, const ObstacleMap& map = {}) {
  struct State {
    std::vector<Step> steps;
    Options options = asInTheNode();
    History history;
  };
  auto state = std::make_shared<State>();
  for (std::size_t i = 0; i < frames.size(); ++i) {
    Step step;
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      step.bodies.push_back(test::moving(bodies[b], frames[i][b], frames[(i + 1) % frames.size()][b]));
    }
    step.map = map;
    state->steps.push_back(step);
  }
  return {name, [state](std::size_t round, const Deadline& deadline) {
            const Step& step = state->steps[round % state->steps.size()];
            const Outcome outcome = detect(step, state->options, state->history, deadline);
            return !outcome.complete;
          }};
}

Positions flat(std::size_t rows, std::size_t cols, double spacing_m) {
  Positions positions;
  for (std::size_t i = 0; i < rows * cols; ++i) {
    positions.emplace_back(spacing_m * static_cast<double>(i % cols), spacing_m * static_cast<double>(i / cols), 0.0);
  }
  return positions;
}

/// Each coordinate by itself.
Positions filled(std::size_t count, const std::function<double()>& coordinate) {
  Positions positions(count);
  for (Vec3& p : positions) {
    for (int axis = 0; axis < 3; ++axis) p[axis] = coordinate();
  }
  return positions;
}

Attack filledStream(const std::string& name, std::size_t side, const std::function<double()>& coordinate) {
  std::vector<std::vector<Positions>> frames;
  for (int i = 0; i < 8; ++i) frames.push_back({filled(side * side, coordinate)});
  return stream(name, {bodyOf("cloth", Topology::grid(side, side))}, frames);
}

Attack collapse(const std::string& name, std::size_t side, const Vec3& point) {
  const Positions there = flat(side, side, 0.01), all(side * side, point);
  return stream(name, {bodyOf("cloth", Topology::grid(side, side))}, {{there}, {all}, {all}});
}

Attack coincidentMeshes() {
  const Body a = bodyOf("a", Topology::grid(40, 40)), b = bodyOf("b", Topology::grid(40, 40));
  Positions at = flat(40, 40, 0.01), moved = at;
  for (Vec3& p : moved) p += Vec3(0.003, 0.001, 0.002);
  return stream("two meshes of 1,600 vertices, the same to the bit", {a, b}, {{at, at}, {moved, moved}});
}

Attack crumpledSheets(std::mt19937_64& random) {
  std::uniform_real_distribution<double> shake(-0.75, 0.75);
  constexpr std::size_t SIDE = 60;
  std::vector<std::vector<Positions>> frames(2);
  for (std::vector<Positions>& frame : frames) {
    for (int b = 0; b < 2; ++b) {
      Positions sheet = flat(SIDE, SIDE, 1);
      for (Vec3& p : sheet) {
        p += Vec3(shake(random), shake(random), 1.5 * std::sin(p.x() + b) * std::cos(p.y()) + 0.8 * b + shake(random));
      }
      frame.push_back(sheet);
    }
  }
  const Body a = bodyOf("a", Topology::grid(SIDE, SIDE)), b = bodyOf("b", Topology::grid(SIDE, SIDE));
  return stream("two crumpled sheets of 3,600 vertices", {a, b}, frames);
}

Attack checkerboard() {
  constexpr double VOXEL_M = 0.05;
  constexpr int SIDE = 96, FIRST = 32768 - SIDE / 2;
  std::vector<OccupiedLeaf> leaves;
  for (int i = 0; i < SIDE * SIDE * SIDE; ++i) {
    const int x = i % SIDE, y = i / SIDE % SIDE, z = i / SIDE / SIDE;
    if ((x + y + z) % 2) continue;
    OccupiedLeaf leaf;
    leaf.min = {static_cast<std::uint16_t>(FIRST + x), static_cast<std::uint16_t>(FIRST + y),
                static_cast<std::uint16_t>(FIRST + z)};
    leaves.push_back(leaf);
  }
  ObstacleMap map;
  map.surface = VoxelSurface::build(VOXEL_M, leaves);
  const Positions here = {Vec3(-2, -2, -2), Vec3(2, -2, -1.9), Vec3(-2, 2, 2)};
  Positions there = here;
  for (Vec3& p : there) p += Vec3(0.3, 0.2, 0.1);
  return stream("a triangle in a checkerboard of 442,368 voxels",
                {bodyOf("triangle", Topology::fromTriangles(3, {{0, 1, 2}}))}, {{here}, {there}}, map);
}

Attack realScene(const std::string& name) {
  const test::SceneData scene = test::readScene(name);
  Positions t0, t1;
  for (const VertexMotion& v : scene.vertices) {
    t0.emplace_back(v.t0[0], v.t0[1], v.t0[2]);
    t1.emplace_back(v.t1[0], v.t1[1], v.t1[2]);
  }
  return stream(name + ", " + std::to_string(scene.faces.size()) + " triangles",
                {bodyOf(name, Topology::fromTriangles(t0.size(), scene.faces))}, {{t0}, {t1}});
}

std::vector<Attack> attacks(const std::vector<std::string>& scenes) {
  std::mt19937_64 random(17);
  const auto any_size = [&] {  // from the smallest denormal double to 0.1 m, by exponent
    return std::ldexp(std::uniform_real_distribution<double>(-1, 1)(random),
                      std::uniform_int_distribution<int>(-1074, -4)(random));
  };
  const auto any_float = [&] {
    const auto bits = static_cast<std::uint32_t>(random());
    float value;
    std::memcpy(&value, &bits, sizeof value);
    return static_cast<double>(value);
  };
  std::vector<Attack> all;
  all.push_back(filledStream("doubles from denormal to 0.1 m, 16 x 16", 16, any_size));
  all.push_back(filledStream("random float32 bytes, 16 x 16", 16, any_float));
  all.push_back(collapse("a cloth of 400 vertices that collapses", 20, Vec3(0.1, 0.2, 0.3)));
  all.push_back(collapse("a cloth of 900 vertices that collapses", 30, Vec3(0.1, 0.2, 0.3)));
  all.push_back(collapse("a cloth of 1,600 vertices, then zeros", 40, Vec3(0, 0, 0)));
  all.push_back(coincidentMeshes());
  all.push_back(crumpledSheets(random));
  all.push_back(checkerboard());
  for (const std::string& scene : scenes) all.push_back(realScene(scene));
  return all;
}

/// Of sorted values.
double quantile(const std::vector<double>& values, double share) {
  return values.empty() ? 0 : values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

nlohmann::json measure(const Attack& attack, double budget_ms, std::size_t steps) {
  std::vector<double> over_ms;
  std::size_t cut = 0;
  for (std::size_t round = 0; round < steps; ++round) {
    over_ms.push_back(overrunMs(budget_ms, [&] { cut += attack.run(round, Deadline::after(budget_ms)); }));
  }
  std::sort(over_ms.begin(), over_ms.end());
  return {{"input", attack.name},
          {"budget_ms", budget_ms},
          {"steps", steps},
          {"cut", cut},
          {"over_ms",
           {{"p50", quantile(over_ms, 0.5)},
            {"p95", quantile(over_ms, 0.95)},
            {"p99", quantile(over_ms, 0.99)},
            {"max", quantile(over_ms, 1)}}}};
}

nlohmann::json measureAll(const std::vector<std::string>& scenes, std::size_t steps, const std::string& only) {
  nlohmann::json out{{"machine", machine()}, {"runs", nlohmann::json::array()}};
  for (const Attack& attack : attacks(scenes)) {
    if (attack.name.find(only) == std::string::npos) continue;
    const Stopwatch watch;
    attack.run(0, Deadline::after(LONGEST_MS));
    const double whole_ms = watch.milliseconds();
    attack.run(1, Deadline::after(LONGEST_MS));  // what is made once for many steps is made
    for (const double budget_ms : BUDGETS_MS) {
      out["runs"].push_back(measure(attack, budget_ms, steps));
      out["runs"].back()["whole_ms"] = whole_ms;
      std::cerr << out["runs"].back().dump() << '\n';
    }
  }
  return out;
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  std::string out, only;
  std::size_t steps = 200;
  std::vector<std::string> scenes;
  CLI::App app("Measures how far steps run over their budget.");
  app.add_option("--out", out, "JSON file to write")->required();
  app.add_option("--steps", steps, "steps of each input and budget")->check(CLI::PositiveNumber);
  app.add_option("--scenes", scenes, "real scenes, from the data with truth");
  app.add_option("--only", only, "only inputs whose name contains this");
  CLI11_PARSE(app, argc, argv);
  try {
    std::ofstream(out) << dccd::benchmarks::measureAll(scenes, steps, only).dump(1) << '\n';
  } catch (const std::exception& e) {
    std::cerr << "budget_benchmark: " << e.what() << '\n';
    return 1;
  }
  return 0;
}
