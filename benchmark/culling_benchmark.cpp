// What the certificates of surfaces that do not fold buy: the whole step with and without them, runs in turn, on a
// cloth that hardly folds, on what folds in one place or is closed, and on what folds everywhere. Contacts are compared
// before a time is written.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <deque>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

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
  Positions t0, t1;
};

/// A cloth in the wind: side x side points, waves a third as high as they are long, moving on by a twelfth.
Case wavingCloth(std::size_t side) {
  Case c;
  c.name = "waving cloth";
  c.topology = std::make_shared<const Topology>(Topology::grid(side, side));
  for (std::size_t r = 0; r < side; ++r) {
    for (std::size_t k = 0; k < side; ++k) {
      const double x = static_cast<double>(k) / static_cast<double>(side),
                   y = static_cast<double>(r) / static_cast<double>(side);
      const double phase = 2 * M_PI * (2 * x + y);
      c.t0.emplace_back(x, y, 0.05 * std::sin(phase));
      c.t1.emplace_back(x + 0.002, y, 0.05 * std::sin(phase + M_PI / 6));
    }
  }
  return c;
}

Case made(const std::string& name, const Topology& topology, const Positions& t0, const Positions& t1) {
  return {name, std::make_shared<const Topology>(topology), t0, t1};
}

nlohmann::json measure(const Case& c, int repeat) {
  Body body;
  body.name = "cloth";
  body.topology = c.topology;
  const Step step = test::stepOf(body, c.t0, c.t1);
  std::deque<test::Detector> detectors;
  for (const bool with : {false, true}) {
    Options options;
    options.keep_bounds = false;  // the same step again and again
    options.check_start_state = false;
    options.unfolded_test = with;
    detectors.emplace_back(options);
  }
  std::vector<double> times[2], ratios;
  std::size_t contacts = 0;
  bool certified = false;
  std::uint64_t parts = 0, pairs = 0;
  for (int r = 0; r < repeat; ++r) {
    for (std::size_t with = 0; with < 2; ++with) {
      const Stopwatch watch;
      const Outcome result = detectors[with].run(step);
      times[with].push_back(watch.milliseconds());
      if (with == 0) contacts = result.contacts.size();
      if (result.contacts.size() != contacts) throw std::runtime_error(c.name + ": the test changes the contacts");
      certified = result.stats.unfolded_bodies == 1;
      parts = std::max(parts, result.stats.unfolded_parts);
      pairs = std::max(pairs, result.stats.unfolded_pairs);
    }
    ratios.push_back(times[0].back() / times[1].back());
  }
  return {{"case", c.name},
          {"triangles", c.topology->faces().size()},
          {"contacts", contacts},
          {"certified", certified},
          {"parts", parts},
          {"pairs", pairs},
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
  CLI::App app("Times the step with and without the culling of surfaces, and parts of them, that do not fold.");
  app.add_option("--out", out, "JSON file to write")->required();
  app.add_option("--repeat", repeat, "runs of each case")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  try {
    std::vector<Case> cases{
        wavingCloth(101), wavingCloth(216),
        made("sheet with a fold over a tenth", Topology::grid(101, 101), test::rolled(101, 2.8, 0.02, 0.1),
             test::rolled(101, 3, 0.02, 0.1)),
        made("sheet with a fold over a tenth", Topology::grid(216, 216), test::rolled(216, 2.8, 0.02, 0.1),
             test::rolled(216, 3, 0.02, 0.1)),
        made("bending tube", test::tube(101, 100), test::tubeAt(101, 100, 0.1), test::tubeAt(101, 100, 0.12))};
    for (const std::size_t side : {80, 160}) {
      const test::Glove glove(side);
      cases.push_back(made("bending glove", glove.topology, glove.curled(0.3), glove.curled(0.33)));
    }
    if (!test::dataDir().empty()) {
      const std::string folder = test::dataDir() + "/scenes/cloth-ball/";
      const test::PlyMesh first = test::readPly(folder + "frame_0.ply"), second = test::readPly(folder + "frame_1.ply");
      cases.push_back({"cloth-ball",
                       std::make_shared<const Topology>(Topology::fromTriangles(first.vertices.size(), first.faces)),
                       first.vertices, second.vertices});
    }
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
