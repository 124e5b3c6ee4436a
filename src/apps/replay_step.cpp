// replay_step FILE: a recorded step once more; exit status 0 when it gives the recorded contacts bit for bit.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <iomanip>
#include <iostream>
#include <sstream>

#include "apps/decimal_options.h"
#include "dccd/monitor_extras.h"
#include "record/explain.h"
#include "record/step_replay.h"

namespace {

using namespace dccd;

struct Arguments {
  std::string file, simd = "auto";
  std::vector<std::string> pairs, bodies;
  int threads = 1;
};

Arguments parse(int argc, char** argv, CLI::App& app) {
  Arguments a;
  app.add_option("FILE", a.file, "a file that ~record_step or a surprise wrote")->required();
  app.add_option(
      "--pair", a.pairs,
      "the pair's way through the stages: VF:v,a,b,c (vertex, face), EE:a,b,c,d (two edges), or with the map "
      "VX:v,x,y,z, EX:a,b,x,y,z, FX:a,b,c,x,y,z (vertex, edge or face, and the key of a voxel)");
  app.add_option("--bodies", a.bodies,
                 "the features' bodies for --pair, by name, one for both; default: the first body")
      ->expected(1, 2);
  app.add_option("--threads", a.threads, "worker threads; the answer does not depend on them")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  app.add_option("--simd", a.simd, "SIMD target, or auto; the answer does not depend on it")->capture_default_str();
  requireDecimalNumbers(app);
  app.parse(argc, argv);
  return a;
}

/// What stands behind the colon, as many numbers as the kind has, each below the limit.
std::vector<std::uint32_t> numbersOf(const std::string& text, std::size_t count) {
  std::istringstream in(text.substr(3));
  std::vector<std::uint32_t> numbers;
  for (std::string word; std::getline(in, word, ',');) {
    const auto number = decimalInteger(word);
    if (!number || *number < 0 || *number >= NO_INDEX) {
      throw std::invalid_argument("--pair " + text + ": '" + word + "' is no number of a vertex or a voxel");
    }
    numbers.push_back(static_cast<std::uint32_t>(*number));
  }
  if (numbers.size() != count || text.back() == ',') {
    throw std::invalid_argument("--pair " + text + ": " + std::to_string(count) +
                                " numbers are needed, separated by commas");
  }
  return numbers;
}

std::uint16_t bodyOf(const Arguments& a, std::size_t side, const StepRecording& recording) {
  if (a.bodies.empty()) return 0;
  const std::string& name = a.bodies[std::min(side, a.bodies.size() - 1)];
  std::size_t b = 0;
  while (b < recording.step.bodies.size() && recording.step.bodies[b].name != name) ++b;
  if (b == recording.step.bodies.size()) throw std::invalid_argument("--bodies: no body is called '" + name + "'");
  return static_cast<std::uint16_t>(b);
}

std::vector<TraceLine> traceOf(const std::string& text, const Arguments& a, const StepRecording& recording) {
  static const char* const KINDS[] = {"VF:", "EE:", "VX:", "EX:", "FX:"};  // by PairKind
  const auto kind = std::find(std::begin(KINDS), std::end(KINDS), text.substr(0, 3));
  if (kind == std::end(KINDS)) {
    throw std::invalid_argument("--pair " + text +
                                ": write VF:v,a,b,c, EE:a,b,c,d, VX:v,x,y,z, EX:a,b,x,y,z or FX:a,b,c,x,y,z");
  }
  PairQuestion q;
  q.kind = static_cast<PairKind>(kind - KINDS);
  for (std::size_t side = 0; side < 2; ++side) q.body[side] = bodyOf(a, side, recording);
  const auto& facts = factsOf(q.kind);
  const std::ptrdiff_t vertices = facts.vertices[0] + facts.vertices[1];
  const std::vector<std::uint32_t> numbers =
      numbersOf(text, static_cast<std::size_t>(vertices) + (facts.isOnMap() ? 3 : 0));
  q.vertex.assign(numbers.begin(), numbers.begin() + vertices);
  if (facts.isOnMap()) {
    const std::uint32_t* key = numbers.data() + vertices;
    if (*std::max_element(key, key + 3) > 65535) {
      throw std::invalid_argument("--pair " + text + ": a voxel's key is at most 65535");
    }
    q.voxel = {static_cast<std::uint16_t>(key[0]), static_cast<std::uint16_t>(key[1]),
               static_cast<std::uint16_t>(key[2])};
  }
  return explain(recording.step, recording.options, q);
}

void trace(const Arguments& a, const StepRecording& recording) {
  for (const std::string& text : a.pairs) {
    std::cout << '\n' << text << '\n';
    std::size_t part = 0;
    for (const TraceLine& line : traceOf(text, a, recording)) {
      if (line.part != part) std::cout << "  part " << (part = line.part) + 1 << " of the step\n";
      std::cout << "  " << std::left << std::setw(15) << line.stage << std::setw(10) << toString(line.says) << line.text
                << '\n';
    }
  }
}

void describe(const StepRecording& r) {
  std::cout << std::fixed << std::setprecision(9) << "step " << r.step.sequence << " from "
            << static_cast<double>(r.step.start_ns) * 1e-9 << " s to " << static_cast<double>(r.step.stamp_ns) * 1e-9
            << " s, accuracy " << toString(r.options.accuracy.rung) << "; " << r.note << '\n'
            << std::defaultfloat;
  for (const Body& body : r.step.bodies) {
    const Topology& topology = *body.topology;
    std::cout << "  body '" << body.name << "': " << body.t0->size() << " vertices, "
              << (topology.hasFaces() ? topology.faces().size() : topology.edges().size())
              << (topology.hasFaces() ? " faces\n" : " edges\n");
  }
  if (r.step.map.surface) std::cout << "  map: " << r.step.map.surface->leafCount() << " occupied leaves\n";
}

void show(const Outcome& answer, const StepRecording& recording) {
  constexpr std::size_t MOST = 10;
  std::cout << "replayed: " << toString(answer.status) << ", " << answer.contacts.size() << " contacts, start state "
            << toString(answer.start_state) << '\n'
            << std::setprecision(17);
  for (std::size_t i = 0; i < std::min(MOST, answer.contacts.size()); ++i) {
    const Contact& c = answer.contacts[i];
    std::cout << "  " << describeContact(c, recording.step.bodies) << "  toc [" << c.toc_lower << ", " << c.toc_upper
              << "]" << (c.certainty == Certainty::UNDECIDED ? " undecided" : "") << (c.initial ? " initial" : "")
              << (c.leaving ? " leaving" : "") << '\n';
  }
  if (answer.contacts.size() > MOST) std::cout << "  ...\n";
}

int replay(const Arguments& a) {
  setSimdTarget(a.simd);
  const StepRecording recording = readRecordingFile(a.file);
  describe(recording);
  const StepReplay result = replayStep(recording, a.threads);
  show(result.answer, recording);
  if (!a.pairs.empty()) trace(a, recording);
  if (!recording.has_answer || !recording.answer.answered) {
    std::cout << "nothing to compare with: the recorded step had no answer"
              << (recording.answer.reason.empty() ? "" : " (" + recording.answer.reason + ")") << '\n';
    return result.answer.answered ? 0 : 1;
  }
  for (const std::string& line : result.differences) std::cout << "differs: " << line << '\n';
  if (!result.differences.empty()) return 1;
  std::cout << (recording.answer.complete
                    ? "the same as recorded, bit for bit\n"
                    : "the recorded step ran out of its budget; what it was certain of is confirmed\n");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"A recorded step once more; exit status 1 when its answer differs from the recorded one, 2 on an error"};
  try {
    return replay(parse(argc, argv, app));
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    std::cerr << "replay_step: " << error.what() << '\n';
    return 2;
  }
}
