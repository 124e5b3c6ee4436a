// cliffs_benchmark: whole steps of input that looks like its neighbours, against these neighbours, in turns, in
// processor time. A cliff is a step that takes several times what the same one takes with its last digits changed, or
// along the axes. Rows that were found once have limits; a search makes random scenes of the same kind.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>

#include "dccd/detect.h"
#include "support/generated_shapes.h"
#include "support/timing.h"

namespace dccd {
namespace benchmarks {
namespace {

constexpr double NOISE_M = 1e-6;  // of the neighbour that has some
constexpr double BUDGET_MS = 5;   // that each step has to keep to
constexpr int CUT_STEPS = 20;     // of which the one that runs furthest over it is told

/// Of this process: what else runs on the machine does not count [ms].
double processorMs() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

/// Two bodies as they are along the axes, and how they lie in space.
struct Scene {
  std::array<test::TriangleShape, 2> shape;
  std::array<Vec3, 2> from{Vec3::Zero(), Vec3::Zero()}, to{Vec3::Zero(), Vec3::Zero()};  // where their origins are
  Eigen::Matrix3d frame = Eigen::Matrix3d::Identity();
  double scale = 1;
  bool distances = false;
  std::vector<double> replaced{};  // coordinates 0 become these in turn
};

Step stepOf(const Scene& scene, double noise_m) {
  std::mt19937_64 random(20170601);
  std::uniform_real_distribution<double> noise(-noise_m, noise_m);
  Step step;
  step.bodies.resize(2);
  std::size_t zeros = 0;
  for (std::size_t b = 0; b < 2; ++b) {
    Body& body = step.bodies[b];
    body.name = b == 0 ? "one" : "other";
    body.topology = share(Topology::fromTriangles(scene.shape[b].vertices.size(), scene.shape[b].faces));
    body.self_collision = false;
    const auto placed = [&](const Vec3& origin) {
      Positions positions;
      for (const Vec3& p : scene.shape[b].vertices) {
        Vec3 x = scene.frame * (p + origin);
        if (noise_m > 0) x += Vec3(noise(random), noise(random), noise(random));
        x *= scene.scale;
        for (int k = 0; k < 3 && !scene.replaced.empty(); ++k) {
          if (x[k] == 0) x[k] = scene.replaced[zeros++ % scene.replaced.size()];
        }
        positions.push_back(x);
      }
      return share(std::move(positions));
    };
    body.t0 = placed(scene.from[b]);
    body.t1 = scene.to[b] == scene.from[b] && noise_m == 0 ? body.t0 : placed(scene.to[b]);
  }
  return step;
}

/// A step, how it is asked, and what it took.
struct Asked {
  std::string name;
  Step step;
  Options options;
  Outcome outcome;
  double ms = HUGE_VAL;

  void run() {
    History history;
    const double begin = processorMs();
    outcome = detect(step, options, history);
    ms = std::min(ms, processorMs() - begin);
  }
  /// To and fro in one history, after two steps that make what is made once: the most that a step took past its budget.
  double overrunOfBudget() const {
    std::array<Step, 2> ways{step, step};
    for (Body& body : ways[1].bodies) std::swap(body.t0, body.t1);
    History history;
    double most_ms = 0;
    for (const Step& way : ways) detect(way, options, history);
    for (int i = 0; i < CUT_STEPS; ++i) {
      most_ms = std::max(
          most_ms, overrunMs(BUDGET_MS, [&] { detect(ways[i % 2], options, history, Deadline::after(BUDGET_MS)); }));
    }
    return most_ms;
  }
  std::size_t faces() const {
    return step.bodies[0].topology->faces().size() + step.bodies[1].topology->faces().size();
  }
  std::size_t found() const { return outcome.contacts.size() + outcome.intersections.size(); }
};

Asked asked(const std::string& name, const Scene& scene, double noise_m = 0) {
  Asked result;
  result.name = name;
  result.step = stepOf(scene, noise_m);
  result.options.clearance.wanted = scene.distances;
  return result;
}

/// A step and its neighbours, each with what it may take of theirs, for what it finds, or for its faces.
struct Row {
  std::string name;
  double at_most = 0;
  bool of_faces = false;
  std::vector<Asked> steps;  // the first is the one in question
};

Scene sliding(double cells_past, const Eigen::Matrix3d& frame) {
  constexpr double CELL = 1.0 / 59;
  Scene scene;
  scene.shape.fill(test::sheet(59, 1));
  scene.from[1] = Vec3(0.31, 0.17, 0) * CELL;
  scene.to[0] = Vec3(cells_past * CELL / 2, 0.1 * CELL, 0);
  scene.to[1] = scene.from[1] - Vec3(cells_past * CELL / 2, -0.23 * CELL, 0);
  scene.frame = frame;
  return scene;
}

Scene parallel(std::size_t cells, const Eigen::Matrix3d& frame) {
  Scene scene;
  scene.shape.fill(test::sheet(cells, 1));
  scene.from[1] = scene.to[1] = Vec3(0.3 / static_cast<double>(cells), 0.2 / static_cast<double>(cells), 0.1);
  scene.frame = frame;
  scene.distances = true;
  return scene;
}

/// A sphere of 2 * segments * (rings - 1) faces.
test::TriangleShape sphere(std::size_t rings, std::size_t segments, double radius) {
  return test::revolution(rings, segments, radius,
                          [radius](double x) { return std::sqrt(std::max(0.0, radius * radius - x * x)); });
}

std::vector<Row> knownRows() {
  const Eigen::Matrix3d along = Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d tilted = Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  const Eigen::Matrix3d degree = Eigen::AngleAxisd(M_PI / 180, Vec3::UnitX()).toRotationMatrix();
  const auto scaled = [](Scene scene, double scale) {
    scene.scale = scale;
    return scene;
  };
  std::vector<Row> rows;
  for (const double past : {0.7, 8.5}) {
    rows.push_back({"two sheets in a plane, both slide " + std::to_string(past).substr(0, 3) + " cells past",
                    past < 1 ? 2.0 : 3.0,
                    false,
                    {asked("along no axis", sliding(past, tilted)), asked("with noise", sliding(past, tilted), NOISE_M),
                     asked("at z = 0", sliding(past, along))}});
  }
  for (const std::size_t cells : {79, 99}) {
    rows.push_back({"clearance of parallel sheets",
                    3,
                    true,
                    {asked("tilted", parallel(cells, tilted)), asked("along an axis", parallel(cells, along)),
                     asked("tilted by 1 degree", parallel(cells, degree)),
                     asked("tilted, with noise", parallel(cells, tilted), NOISE_M)}});
  }
  Scene spheres;
  spheres.shape = {sphere(71, 70, 0.4), sphere(71, 70, 0.5)};
  spheres.distances = true;
  Scene beside = spheres;
  beside.shape[1] = spheres.shape[0];
  beside.from[1] = beside.to[1] = Vec3(0, 0, 0.9);
  rows.push_back(
      {"clearance of concentric spheres",
       8,
       true,
       {asked("concentric", spheres), asked("side by side", beside), asked("with noise", spheres, NOISE_M)}});
  Scene crossing = sliding(0, tilted);
  crossing.from[1] += Vec3(0, 0, 0.1);
  crossing.to[1] -= Vec3(0, 0, 0.1);
  for (const int exponent : {160, -160}) {
    rows.push_back({"sheets crossing, of size 2^" + std::to_string(exponent),
                    3,
                    false,
                    {asked("at that size", scaled(crossing, std::ldexp(1.0, exponent))), asked("at 1 m", crossing)}});
  }
  Scene flat = sliding(0, along);
  flat.from[1] += Vec3(0, 0, 0.1);
  flat.to[1] -= Vec3(0, 0, 0.1);
  Scene tiny = flat, small = flat;
  tiny.replaced = {0, 1e-300};
  small.replaced = {0, 1e-200};
  rows.push_back({"sheets crossing, coordinates in {0, 1e-300}",
                  3,
                  false,
                  {asked("1e-300", tiny), asked("1e-200", small), asked("0 alone", flat)}});
  Scene denormal;
  denormal.shape.fill(test::sheet(20, 1));
  denormal.scale = 1e-310;
  rows.push_back(
      {"a flat sheet and itself", 5, false, {asked("denormal", denormal), asked("at size 1", scaled(denormal, 1))}});
  return rows;
}

/// Two bodies as people make them: planes, spheres, cylinders, stairs, beside, within or through one another, at rest,
/// moving together, sliding or meeting, in any frame and of any size.
Row randomRow(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto draw = [&](int low, int high) { return std::uniform_int_distribution<int>(low, high)(random); };
  const auto share = [&] { return std::uniform_real_distribution<double>(0, 1)(random); };
  const auto shape = [&](int kind, std::size_t cells, double size) {
    test::TriangleShape s;
    if (kind == 1) {
      s = test::cubeSphere(cells / 3);
    } else if (kind == 2) {
      s = test::revolution(cells / 2, cells, 1, [](double x) { return std::fabs(x) < 1 - 1e-9 ? 0.4 : 0; });
    } else {
      s = test::sheet(cells, 2);
      for (Vec3& p : s.vertices) p[2] = kind == 3 ? std::floor(4 * p[0] + 1e-9) / 4 : 0;
    }
    for (Vec3& p : s.vertices) p *= size;
    return s;
  };
  constexpr const char *KINDS[] = {"planes", "spheres", "cylinders", "stairs"},
                       *PLACES[] = {"in one place", "beside", "above"};
  constexpr const char* WAYS[] = {"at rest", "together", "sliding", "meeting", "parting"};
  const int kind = draw(0, 3), place = draw(0, 2), way = draw(0, 4), frame = draw(0, 3);
  const auto cells = static_cast<std::size_t>(draw(12, 30));
  const double cell = 2.0 / static_cast<double>(cells), apart = std::ldexp(share(), -draw(0, 4));
  Scene scene;
  scene.shape[0] = shape(kind, cells, 1);
  const bool closed = kind == 1 || kind == 2;
  // What is closed is within the other one rather than above it.
  scene.shape[1] = shape(kind, cells, closed && place == 2 ? 1 + apart : 1);
  if (place == 1) scene.from[1] = Vec3(1.5, 0.3 * cell, 0);
  if (place == 2 && !closed) scene.from[1] = Vec3(0, 0, apart);
  if (draw(0, 1) == 0) scene.from[1] += cell * Vec3(share(), share(), 0);
  scene.to = scene.from;
  const Vec3 along = cell * draw(1, 6) * Vec3(share(), share(), 0);
  if (way == 1) scene.to[0] += along, scene.to[1] += along;
  if (way == 2) scene.to[0] += along, scene.to[1] -= along;
  if (way == 3) scene.to[1] -= Vec3(0, 0, 2 * apart);
  if (way == 4) scene.to[1] += Vec3(0, 0, apart);
  scene.distances = true;
  scene.scale = draw(0, 2) == 0 ? std::ldexp(1.0, draw(-12, 12)) : draw(0, 1) == 0 ? std::pow(10.0, draw(-3, 3)) : 1;
  Scene axes = scene;
  const Vec3 axis(share() - 0.5, share() - 0.5, share() + 0.1);
  if (frame == 0) scene.frame = Eigen::AngleAxisd(6 * share(), axis.normalized()).toRotationMatrix();
  if (frame == 1) scene.frame = Eigen::AngleAxisd(M_PI / 180 * draw(1, 89), Vec3::Unit(draw(0, 2))).toRotationMatrix();
  if (frame == 2) scene.frame = Eigen::AngleAxisd(M_PI / 4, Vec3::Unit(draw(0, 1))).toRotationMatrix();
  const std::string name = std::to_string(seed) + ": " + KINDS[kind] + " " + PLACES[place] + ", " + WAYS[way];
  return {
      name, 4, false, {asked("as drawn", scene), asked("with noise", scene, NOISE_M), asked("along the axes", axes)}};
}

nlohmann::json measured(Row& row, int repeats) {
  for (int r = 0; r < repeats; ++r) {
    for (Asked& one : row.steps) one.run();
  }
  nlohmann::json result{{"name", row.name}, {"at_most", row.at_most}};
  // A neighbour finds other things, and what finds nothing has its faces to look at.
  const bool of_faces = row.of_faces || std::any_of(row.steps.begin(), row.steps.end(),
                                                    [](const Asked& one) { return one.found() == 0; });
  const auto unit = [&](const Asked& one) {
    return static_cast<double>(of_faces ? one.faces() : one.found() + one.faces());
  };
  for (const Asked& one : row.steps) {
    nlohmann::json step{{"name", one.name},
                        {"ms", one.ms},
                        {"faces", one.faces()},
                        {"contacts", one.outcome.contacts.size()},
                        {"crossings", one.outcome.intersections.size()},
                        {"ratio", row.steps[0].ms / unit(row.steps[0]) / (one.ms / unit(one))}};
    for (std::size_t s = 0; s < one.outcome.stats.stages.size(); ++s) {
      step["stages"][toString(static_cast<Stage>(s))] = one.outcome.stats.stages[s].ms;
    }
    for (std::size_t t = 0; t < one.outcome.stats.tiers.settled.size(); ++t) {
      step["tiers"][toString(static_cast<Tier>(t))] = one.outcome.stats.tiers.settled[t];
    }
    step["clearance_ms"] = one.outcome.stats[Effect::CLEARANCE].ms;
    result["steps"].push_back(step);
  }
  return result;
}

int run(int argc, char** argv) {
  CLI::App app{"Steps that look like their neighbours and take longer"};
  int repeats = 5;
  std::uint64_t scenes = 0, first = 1;
  std::string out, only;
  app.add_option("--repeat", repeats, "repeats in turns")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--only", only, "rows whose name contains this");
  app.add_option("--scenes", scenes, "random scenes to search")->capture_default_str();
  app.add_option("--first", first, "seed of the first of them")->capture_default_str();
  app.add_option("--out", out, "JSON file")->required();
  CLI11_PARSE(app, argc, argv);
  nlohmann::json result{{"machine", machine()}, {"scenes", scenes}, {"found", nlohmann::json::array()}};
  for (Row& row : knownRows()) {
    if (row.name.find(only) == std::string::npos) continue;
    nlohmann::json measured_row = measured(row, repeats);
    for (std::size_t i = 0; i < row.steps.size(); ++i)
      measured_row["steps"][i]["over_budget_ms"] = row.steps[i].overrunOfBudget();
    result["rows"].push_back(measured_row);
    std::cerr << result["rows"].back().dump() << '\n';
  }
  for (std::uint64_t seed = first; seed < first + scenes; ++seed) {
    Row row = randomRow(seed);
    nlohmann::json one = measured(row, 1);
    const auto isDear = [&] {
      return std::any_of(one["steps"].begin(), one["steps"].end(),
                         [&](const nlohmann::json& step) { return step["ratio"] > row.at_most; });
    };
    if (isDear()) one = measured(row, repeats);  // or else the machine was busy
    if (!isDear()) continue;
    result["found"].push_back(one);
    std::cerr << one.dump() << '\n';
  }
  std::ofstream(out) << result.dump(1) << '\n';
  return 0;
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  try {
    return dccd::benchmarks::run(argc, argv);
  } catch (const std::exception& e) {
    std::cerr << "cliffs_benchmark: " << e.what() << '\n';
    return 1;
  }
}
