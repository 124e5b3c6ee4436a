// What the certificates of surfaces that do not fold buy: whole steps with and without them, in processor time of runs
// in turn, on a cloth that hardly folds, on what folds in one place or everywhere, and on recorded scenes. Contacts are
// compared before a time is written.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <deque>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "scenes/physics/scene_file.h"
#include "scenes/physics/shapes.h"
#include "scenes/physics/simulation.h"
#include "simd/group_pairs.h"
#include "support/data.h"
#include "support/detector.h"
#include "support/scene_data.h"
#include "support/surfaces.h"
#include "support/timing.h"

namespace dccd {
namespace benchmarks {
namespace {

struct Case {
  std::string name;
  std::shared_ptr<const Topology> topology;
  std::vector<Positions> frames;  ///< a step between each two
};

/// A cloth in the wind: side x side points, waves a third as high as they are long, moving on by a twelfth.
Case wavingCloth(std::size_t side) {
  Positions t0, t1;
  for (std::size_t r = 0; r < side; ++r) {
    for (std::size_t k = 0; k < side; ++k) {
      const double x = static_cast<double>(k) / static_cast<double>(side),
                   y = static_cast<double>(r) / static_cast<double>(side);
      const double phase = 2 * M_PI * (2 * x + y);
      t0.emplace_back(x, y, 0.05 * std::sin(phase));
      t1.emplace_back(x + 0.002, y, 0.05 * std::sin(phase + M_PI / 6));
    }
  }
  return {"waving cloth", std::make_shared<const Topology>(Topology::grid(side, side)), {t0, t1}};
}

Case made(const std::string& name, const Topology& topology, const Positions& t0, const Positions& t1) {
  return {name, std::make_shared<const Topology>(topology), {t0, t1}};
}

/// The one body of a scene of config/scenes, as make_scene_bag records it.
Case recorded(const std::string& name) {
  const scene::SceneSpec spec = scene::readSceneFile(DEFORMABLE_CCD_SOURCE_DIR "/config/scenes/" + name + ".yaml");
  scene::Simulation simulation(spec, 1);
  std::vector<Positions> frames;
  for (int i = 0; i < spec.frames; ++i) {
    frames.push_back(simulation.positions(0));
    simulation.step();
  }
  const Topology topology = Topology::fromTriangles(frames[0].size(), scene::shapeFaces(spec.bodies.at(0).shape));
  return {name, std::make_shared<const Topology>(topology), std::move(frames)};
}

double processorMs() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// What the steps of a case came to, one after another.
struct Run {
  double ms = 0;
  std::size_t contacts = 0, certified = 0;
  std::uint64_t looked_at = 0;

  void add(test::Detector& detector, const Step& step) {
    const double begin = processorMs();
    const Outcome outcome = detector.run(step);
    ms += processorMs() - begin;
    contacts += outcome.contacts.size();
    certified += outcome.stats.unfolded_bodies;
    looked_at += outcome.stats[Stage::BROAD_PHASE].in / (simd::GROUP * simd::GROUP);
  }
};

/// Two detectors, without and with the certificates, of bodies that are set up. What a certificate that failed tells
/// the next steps is the stream's, so that each run of a stream has its own.
void prepare(std::deque<test::Detector>& detectors, const Step& step) {
  detectors.clear();
  for (const bool with : {false, true}) {
    Options options;
    options.keep_bounds = false;  // the same step again and again
    options.check_start_state = false;
    options.unfolded_test = with;
    detectors.emplace_back(options).run(step);
  }
}

nlohmann::json measure(const Case& c, int repeat) {
  Body body;
  body.name = "cloth";
  body.topology = c.topology;
  std::vector<Step> steps;
  for (std::size_t k = 1; k < c.frames.size(); ++k) steps.push_back(test::stepOf(body, c.frames[k - 1], c.frames[k]));
  std::deque<test::Detector> detectors;
  const double count = static_cast<double>(steps.size());
  std::vector<double> times[2], ratios;
  Run last[2];
  for (int r = 0; r < repeat; ++r) {
    if (r == 0 || steps.size() > 1) prepare(detectors, steps[0]);
    Run runs[2];
    for (const Step& step : steps) {
      for (std::size_t with = 0; with < 2; ++with) runs[with].add(detectors[with], step);
      if (runs[0].contacts != runs[1].contacts) throw std::runtime_error(c.name + ": the test changes the contacts");
    }
    for (std::size_t with = 0; with < 2; ++with) times[with].push_back(runs[with].ms / count);
    ratios.push_back(runs[0].ms / runs[1].ms);
    std::copy(runs, runs + 2, last);
  }
  return {{"case", c.name},
          {"triangles", c.topology->faces().size()},
          {"steps", steps.size()},
          {"contacts", last[0].contacts},
          {"certified", last[1].certified},
          {"cluster_pairs", static_cast<double>(last[0].looked_at) / count},
          {"looked_at", static_cast<double>(last[1].looked_at) / count},
          {"without_ms", spread(times[0])},
          {"with_ms", spread(times[1])},
          {"ratio", quartiles(ratios)}};
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  using namespace dccd;
  using namespace dccd::benchmarks;
  std::string out;
  int repeat = 25;
  CLI::App app("Times the step with and without the culling of surfaces that do not fold.");
  app.add_option("--out", out, "JSON file to write")->required();
  app.add_option("--repeat", repeat, "runs of each case")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  try {
    std::vector<Case> cases{wavingCloth(101), wavingCloth(216),
                            made("sheet with a fold over a tenth", Topology::grid(101, 101),
                                 test::rolled(101, 2.8, 0.02, 0.1), test::rolled(101, 3, 0.02, 0.1)),
                            made("sheet with a fold over a tenth", Topology::grid(216, 216),
                                 test::rolled(216, 2.8, 0.02, 0.1), test::rolled(216, 3, 0.02, 0.1))};
    if (!test::dataDir().empty()) {
      const std::string folder = test::dataDir() + "/scenes/cloth-ball/";
      const test::PlyMesh first = test::readPly(folder + "frame_0.ply"), second = test::readPly(folder + "frame_1.ply");
      cases.push_back({"cloth-ball",
                       std::make_shared<const Topology>(Topology::fromTriangles(first.vertices.size(), first.faces)),
                       {first.vertices, second.vertices}});
    }
    for (const char* scene : {"flag_in_wind", "folded_tube", "table_edge"}) cases.push_back(recorded(scene));
    nlohmann::json result{{"machine", machine()}};
    for (const Case& c : cases) {
      result["runs"].push_back(measure(c, repeat));
      std::cerr << result["runs"].back().dump() << '\n';
    }
    std::ofstream(out) << result.dump(1) << '\n';
  } catch (const std::exception& e) {
    std::cerr << "culling_benchmark: " << e.what() << '\n';
    return 1;
  }
  return 0;
}
