// The whole step on scenes of one kind and many sizes: does the time per triangle grow? Contacts are compared between
// thread counts before a time is written.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

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
    std::ofstream(out) << result.dump(1) << '\n';
  } catch (const std::exception& e) {
    std::cerr << "scaling_benchmark: " << e.what() << '\n';
    return 1;
  }
  return 0;
}
