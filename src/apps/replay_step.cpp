// replay_step FILE: a recorded step once more; exit status 0 when it gives the recorded contacts bit for bit.
#include <CLI/CLI.hpp>
#include <iomanip>
#include <iostream>
#include <sstream>

#include "deformable_ccd/simd_target.h"
#include "detector/pair_trace.h"
#include "io/step_replay.h"

namespace {

using namespace deformable_ccd;

struct Arguments {
  std::string file, simd = "auto";
  std::vector<std::string> pairs, bodies;
  int threads = 1;
  std::size_t show = 10;
};

Arguments parse(int argc, char** argv, CLI::App& app) {
  Arguments a;
  app.add_option("FILE", a.file, "a file that ~record_step, a surprise or the crash handler wrote")->required();
  app.add_option("--pair", a.pairs, "VF:v,a,b,c (vertex, face) or EE:a,b,c,d (two edges): the pair's way through the stages");
  app.add_option("--bodies", a.bodies, "the two features' bodies for --pair, by name; default: the first body for both")
      ->expected(2);
  app.add_option("--threads", a.threads, "worker threads; the answer does not depend on them")->check(CLI::Range(1, 256))
      ->capture_default_str();
  app.add_option("--simd", a.simd, "SIMD target, or auto; the answer does not depend on it")->capture_default_str();
  app.add_option("--show", a.show, "contacts to list")->capture_default_str();
  app.parse(argc, argv);
  return a;
}

PairQuestion question(const std::string& text, const Arguments& a, const StepRecording& recording) {
  PairQuestion q;
  const std::string kind = text.substr(0, 3);
  if (kind != "VF:" && kind != "EE:") throw std::invalid_argument("--pair " + text + ": write VF:v,a,b,c or EE:a,b,c,d");
  q.kind = kind == "VF:" ? PairKind::VERTEX_FACE : PairKind::EDGE_EDGE;
  std::istringstream numbers(text.substr(3));
  for (std::size_t i = 0; i < 4; ++i) {
    std::int64_t vertex = -1;
    char comma = ',';
    if ((i > 0 && !(numbers >> comma)) || comma != ',' || !(numbers >> vertex) || vertex < 0 || vertex >= NO_INDEX) {
      throw std::invalid_argument("--pair " + text + ": four vertices are needed, separated by commas");
    }
    q.vertex[i] = static_cast<Index>(vertex);
  }
  std::string rest;
  if (numbers >> rest) throw std::invalid_argument("--pair " + text + ": '" + rest + "' is too much");
  for (std::size_t side = 0; side < a.bodies.size(); ++side) {
    std::size_t b = 0;
    while (b < recording.bodies.size() && recording.bodies[b].setup.name != a.bodies[side]) ++b;
    if (b == recording.bodies.size()) throw std::invalid_argument("--bodies: no body is called '" + a.bodies[side] + "'");
    q.body[side] = static_cast<std::uint16_t>(b);
  }
  return q;
}

void trace(const Arguments& a, const StepRecording& recording) {
  StepInput input;
  input.resize(recording.bodies.size());
  std::vector<MonitorBody> bodies;
  for (std::size_t b = 0; b < recording.bodies.size(); ++b) {
    const RecordedBody& body = recording.bodies[b];
    bodies.push_back(body.setup);
    input.t0[b] = body.t0;
    input.t1[b] = body.t1;
    input.topologies[b] = body.topology;
    input.rigid[b] = body.rigid;
    input.pose_t0[b] = body.pose_t0;
    input.pose_t1[b] = body.pose_t1;
    input.radius_m[b] = body.radius_m;
    input.references[b] = body.reference;
  }
  for (const std::string& text : a.pairs) {
    std::cout << '\n' << text << "  (* the rung of the recording)\n";
    std::size_t part = 0;
    for (const TraceLine& line : tracePair(input, bodies, recording.options, question(text, a, recording))) {
      if (line.part != part) std::cout << "  part " << (part = line.part) + 1 << " of the step\n";
      std::cout << "  " << std::left << std::setw(15) << line.stage << std::setw(10) << toString(line.says) << line.text << '\n';
    }
  }
}

void describe(const StepRecording& r) {
  std::cout << std::fixed << std::setprecision(9) << "step " << r.sequence << " from " << static_cast<double>(r.start_ns) * 1e-9
            << " s to " << static_cast<double>(r.stamp_ns) * 1e-9 << " s, accuracy "
            << toString(r.options.detector.accuracy.rung) << "; " << r.note << '\n' << std::defaultfloat;
  for (const RecordedBody& body : r.bodies) {
    std::cout << "  body '" << body.setup.name << "': " << body.t0.size() << " vertices, " << body.topology->faces().size()
              << " faces\n";
  }
  if (r.map.surface) std::cout << "  map: " << r.map.surface->leafCount() << " occupied leaves\n";
}

void show(const RecordedAnswer& answer, const StepRecording& recording, std::size_t most) {
  std::cout << "replayed: " << toString(answer.status) << ", " << answer.contacts.size() << " contacts, start state "
            << toString(answer.start_state) << '\n' << std::setprecision(17);
  for (std::size_t i = 0; i < std::min(most, answer.contacts.size()); ++i) {
    const core::Contact& c = answer.contacts[i];
    std::cout << "  " << describeContact(c, recording.bodies) << "  toc [" << c.toc_lower << ", " << c.toc_upper << "]"
              << (c.certainty == Certainty::UNDECIDED ? " undecided" : "") << (c.initial ? " initial" : "")
              << (c.leaving ? " leaving" : "") << '\n';
  }
  if (answer.contacts.size() > most) std::cout << "  ...\n";
}

int replay(const Arguments& a) {
  setSimdTarget(a.simd);
  const StepRecording recording = readRecordingFile(a.file);
  describe(recording);
  const StepReplay result = replayStep(recording, a.threads);
  show(result.answer, recording, a.show);
  if (!a.pairs.empty()) trace(a, recording);
  if (!recording.answer.present || !recording.answer.answered) {
    std::cout << "nothing to compare with: the recorded step had no answer"
              << (recording.answer.reason.empty() ? "" : " (" + recording.answer.reason + ")") << '\n';
    return result.answer.answered ? 0 : 1;
  }
  for (const std::string& line : result.differences) std::cout << "differs: " << line << '\n';
  if (!result.differences.empty()) return 1;
  std::cout << (recording.answer.complete ? "the same as recorded, bit for bit\n"
                                          : "the recorded step ran out of its budget; what it was certain of is confirmed\n");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"A recorded step once more; exit status 1 when its answer differs from the recorded one, 2 on an error"};
  try {
    return replay(parse(argc, argv, app));
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  } catch (const std::exception& error) {
    std::cerr << "replay_step: " << error.what() << '\n';
    return 2;
  }
}
