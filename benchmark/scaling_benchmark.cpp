// The whole step on scenes of one kind and many sizes: does the time per triangle grow? Contacts are compared between
// thread counts before a time is written. And the memory that a body in a stream takes.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "dccd/stream.h"
#include "dccd/voxel_surface.h"
#include "support/detector.h"
#include "support/generated_scene.h"
#include "support/timing.h"

namespace dccd {
namespace benchmarks {
namespace {

struct Frames {
  std::vector<test::GeneratedBody> bodies;
  std::vector<Positions> t0, t1;  // one a body
  std::size_t triangles = 0;
};

Frames generate(const std::string& kind, std::size_t triangles, std::size_t frame) {
  test::GeneratedOptions options;
  options.triangles = triangles;
  const auto sequence = test::generateSequence(test::generatedKindFromString(kind), options);
  Frames frames;
  frames.bodies = sequence->bodies();
  frames.triangles = sequence->triangleCount();
  const auto split = [&](std::vector<Positions>& out) {
    for (const test::GeneratedBody& b : frames.bodies) {
      const auto first = sequence->positions().begin() + b.vertex_offset;
      out.emplace_back(first, first + static_cast<std::ptrdiff_t>(b.topology.vertexCount()));
    }
  };
  sequence->advanceTo(frame);
  split(frames.t0);
  sequence->advance();
  split(frames.t1);
  return frames;
}

bool sameContacts(const std::vector<Contact>& a, const std::vector<Contact>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Contact& x, const Contact& y) {
    return x.kind == y.kind && x.body == y.body && x.vertex == y.vertex && x.toc_lower == y.toc_lower &&
           x.toc_upper == y.toc_upper && x.certainty == y.certainty;
  });
}

nlohmann::json measure(const Frames& frames, int threads, int repeat, std::vector<Contact>& reference) {
  Options options;
  options.keep_bounds = false;  // the same step again and again
  options.num_threads = threads;
  options.check_start_state = false;  // the scenes start with surfaces through each other
  test::Detector detector(options);
  Step step;
  for (std::size_t b = 0; b < frames.bodies.size(); ++b) {
    Body setup;
    setup.name = frames.bodies[b].name;
    setup.topology = std::make_shared<const Topology>(frames.bodies[b].topology);
    setup.self_collision = frames.bodies[b].deforms;
    step.bodies.push_back(test::moving(setup, frames.t0[b], frames.t1[b]));
  }
  const std::size_t memory_before = residentBytes();
  std::vector<double> times;
  nlohmann::json out;
  for (int r = 0; r < repeat; ++r) {
    const Stopwatch watch;
    const Outcome result = detector.run(step);
    times.push_back(watch.milliseconds());
    if (r > 0) continue;
    if (reference.empty()) reference = result.contacts;
    if (!sameContacts(reference, result.contacts)) throw std::runtime_error("contacts differ between thread counts");
    out = {{"triangles", frames.triangles},
           {"threads", threads},
           {"candidates", result.stats.vf_candidates + result.stats.ee_candidates},
           {"contacts", result.contacts.size()}};
  }
  out["ms"] = spread(times);
  out["bytes_a_triangle"] =
      static_cast<double>(residentBytes() - memory_before) / static_cast<double>(frames.triangles);
  return out;
}

/// What a stream may ask of a body, beside its contacts.
struct Streamed {
  std::string name;
  bool moves = false, with_distances = false, with_own_voxels = false;
};

/// A cloth of 2 m, folded once with 2 cm between its layers, so that nothing certifies that it does not touch itself;
/// all that a monitor holds of it after 40 frames, its mesh included. Distances are those from a map of 2 m, and own
/// voxels of a map that shows the lower layer anew with each third frame.
double bytesOf(const Streamed& asked, std::size_t side) {
  ObstacleMap map;
  if (asked.with_distances || asked.with_own_voxels) {
    std::vector<OccupiedLeaf> leaves;
    const auto z = static_cast<std::uint16_t>(32768 + (asked.with_own_voxels ? 25 : 0));
    for (std::uint16_t i = 0; i < 100; ++i) {
      for (std::uint16_t j = 0; j < 100; ++j) {
        leaves.push_back({{static_cast<std::uint16_t>(32768 + i), static_cast<std::uint16_t>(32768 + j), z}, 1});
      }
    }
    map.surface = VoxelSurface::build(0.02, leaves);
  }
  const std::size_t before = residentBytes();
  Body body;
  body.name = "cloth";
  body.own_voxels_m = asked.with_own_voxels ? ONE_VOXEL : 0;
  MonitorOptions options;
  options.detector.clearance.wanted = asked.with_distances;
  Monitor monitor(options, {body});
  const auto topology = std::make_shared<const Topology>(Topology::grid(side, side));
  Outcome outcome;
  for (int k = 0; k < 40; ++k) {
    MeshFrame frame;
    frame.stamp_ns = 1000000000 + k * 33333333LL;
    frame.topology = topology;
    frame.positions.reserve(side * side);
    for (std::size_t v = 0; v < side * side; ++v) {
      const double edge_m = 2.0 / static_cast<double>(side - 1), x = edge_m * static_cast<double>(v % side);
      const double y = edge_m * static_cast<double>(v / side), folded = std::min(x, 2 - x);
      const double wave = 0.05 * std::sin(3 * folded + 2 * y + (asked.moves ? 0.01 * k : 0));
      frame.positions.emplace_back(folded, y, 0.5 + wave + (x > 1 ? 0.02 : 0));
    }
    if (map.surface && (k == 0 || (asked.with_own_voxels && k % 3 == 0))) {
      map.stamp_ns = frame.stamp_ns;
      monitor.setMap(map);
    }
    monitor.push(0, std::move(frame), k);
    while (monitor.next(k, outcome)) continue;
  }
  if (!outcome.answered) throw std::runtime_error(asked.name + " was not answered");
  return static_cast<double>(residentBytes() - before) / static_cast<double>(topology->faces().size());
}

}  // namespace
}  // namespace benchmarks
}  // namespace dccd

int main(int argc, char** argv) {
  using namespace dccd::benchmarks;
  std::string out, kind = "lion";
  std::vector<std::size_t> sizes{10000, 40000, 160000, 640000, 1600000};
  std::vector<int> threads{1, 2};
  int repeat = 5;
  std::size_t frame = 6;
  CLI::App app("Times the whole step on generated scenes of growing size.");
  app.add_option("--out", out, "JSON file to write")->required();
  app.add_option("--scene", kind, "kind of generated scene");
  app.add_option("--sizes", sizes, "triangles")->delimiter(',');
  app.add_option("--threads", threads, "numbers of threads")->delimiter(',');
  app.add_option("--repeat", repeat, "runs of each step")->check(CLI::PositiveNumber);
  app.add_option("--frame", frame, "frame of the sequence");
  CLI11_PARSE(app, argc, argv);
  try {
    nlohmann::json result{{"scene", kind}, {"machine", machine()}};
    for (std::size_t size : sizes) {
      const auto frames = generate(kind, size, frame);
      std::vector<dccd::Contact> reference;
      for (int n : threads) {
        result["runs"].push_back(measure(frames, n, repeat, reference));
        std::cerr << result["runs"].back().dump() << '\n';
      }
    }
    const std::size_t side = 566;
    for (const Streamed& one :
         {Streamed{"at rest"}, Streamed{"at rest, with distances", false, true}, Streamed{"moves", true},
          Streamed{"moves, with distances", true, true}, Streamed{"moves, with own voxels", true, false, true}}) {
      result["memory"].push_back(
          {{"body", one.name}, {"triangles", 2 * (side - 1) * (side - 1)}, {"bytes_a_triangle", bytesOf(one, side)}});
      std::cerr << result["memory"].back().dump() << '\n';
    }
    std::ofstream(out) << result.dump(1) << '\n';
  } catch (const std::exception& e) {
    std::cerr << "scaling_benchmark: " << e.what() << '\n';
    return 1;
  }
  return 0;
}
