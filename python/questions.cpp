// What is asked of the core: detect, pairs, explain, replay.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <future>
#include <mutex>

#include "module.h"
#include "record/explain.h"
#include "record/step_replay.h"

namespace dccd {
namespace python {

namespace {

constexpr auto LOOK_AT_SIGNALS = std::chrono::milliseconds(50);
constexpr std::size_t SHORT_STEP = 1000;  // edges; a step of fewer is done before anybody presses a key

/// A history that two threads may have in their hands.
struct SharedHistory {
  History history;
  std::mutex mutex;
};

std::function<void()> cancelBy(std::atomic<bool>& cancelled, bool is_long) {
  if (!is_long) return {};
  return [&] { cancelled = true; };
}

Answer detectStep(py::handle bodies, py::handle voxels, py::handle history, const py::dict& options) {
  Step step;
  step.bodies = bodiesOf(bodies);
  step.map = mapOf(voxels);
  Options wanted;
  setOptions(options, step.bodies, wanted);
  if (!history.is_none() && !py::isinstance<SharedHistory>(history)) {
    throw py::type_error("history: expected dccd.History or None");
  }
  const auto own =
      history.is_none() ? std::make_shared<SharedHistory>() : history.cast<std::shared_ptr<SharedHistory>>();
  std::atomic<bool> cancelled{false};
  Outcome outcome;
  const auto work = [&] {
    const std::lock_guard<std::mutex> lock(own->mutex);
    outcome = detect(step, wanted, own->history, deadlineOf(wanted).orWhen(cancelled));
  };
  runUnlocked(work, cancelBy(cancelled, isLong(step.bodies, step.map.surface != nullptr)));
  return Answer(std::move(outcome));
}

struct PairRow {
  double toc_lower, toc_upper;
  bool contact, undecided;
  std::array<std::uint8_t, 6> rest;  // to the next row: written as well, so that equal answers have equal bytes
};
static_assert(sizeof(PairRow) == offsetof(PairRow, rest) + sizeof(PairRow::rest), "no byte is left out");

/// A number of PairKind, or a name of its table.
PairKind kindOf(py::handle kind) {
  std::string known;
  for (std::size_t k = 0; k < std::size(PAIR_KINDS); ++k) {
    const PairKindFacts& facts = PAIR_KINDS[k];
    if (py::isinstance<py::str>(kind)) {
      const std::string name = kind.cast<std::string>();
      if (name == facts.name || name == facts.short_name) return static_cast<PairKind>(k);
    } else if (numberOf(kind, "kind") == static_cast<double>(k)) {
      return static_cast<PairKind>(k);
    }
    known += (known.empty() ? "" : ", ") + std::string(facts.name);
  }
  throw py::value_error("kind is " + py::cast<std::string>(py::repr(kind)) + "; expected one of " + known +
                        ", or its number");
}

std::vector<VertexMotion> motionsOf(const Doubles& t0, const Doubles& t1) {
  std::vector<VertexMotion> vertices(static_cast<std::size_t>(t0.size()) / 3, VertexMotion{});
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      vertices[v].t0[axis] = t0.data()[3 * v + axis];
      vertices[v].t1[axis] = t1.data()[3 * v + axis];
      if (std::isfinite(vertices[v].t0[axis]) && std::isfinite(vertices[v].t1[axis])) continue;
      throw py::value_error("pair " + std::to_string(v / 4) + ", vertex " + std::to_string(v % 4) +
                            " is not finite; leave the pair out");
    }
  }
  return vertices;
}

const py::dtype& pairType() {
  static const py::dtype* type = nullptr;
  return onceMade(type, [] {
    return structured({{"contact", "?", offsetof(PairRow, contact)},
                       {"undecided", "?", offsetof(PairRow, undecided)},
                       {"toc_lower", "f8", offsetof(PairRow, toc_lower)},
                       {"toc_upper", "f8", offsetof(PairRow, toc_upper)}},
                      sizeof(PairRow));
  });
}

py::array rowsOf(const std::vector<ElementaryResult>& results) {
  py::array rows(pairType(), static_cast<py::ssize_t>(results.size()));
  auto* row = static_cast<PairRow*>(rows.mutable_data());
  for (const ElementaryResult& r : results) {
    *row = {r.toc_lower, r.toc_upper, r.verdict == Verdict::CONTACT, r.verdict == Verdict::UNDECIDED, {}};
    // Of what does not touch the rungs say no time.
    if (r.verdict == Verdict::NO_CONTACT) row->toc_lower = row->toc_upper = HUGE_VAL;
    ++row;
  }
  return rows;
}

py::array testPairs(py::handle kind, py::handle t0, py::handle t1, double minimum_separation_m,
                    const py::dict& options) {
  const Doubles start = doublesOf(t0, "t0", {ANY, 4, 3});
  const Doubles end = doublesOf(t1, "t1", {start.shape(0), 4, 3});
  if (!(minimum_separation_m >= 0 && std::isfinite(minimum_separation_m))) {
    throw py::value_error("minimum_separation_m is " + std::to_string(minimum_separation_m) +
                          "; expected a finite number, 0 or more");
  }
  Options wanted;
  setOptions(options, {}, wanted);
  const std::unique_ptr<Rung> rung = makeRung(wanted.accuracy);
  const std::vector<VertexMotion> vertices = motionsOf(start, end);
  std::vector<Quad> quads(vertices.size() / 4);
  for (std::size_t v = 0; v < vertices.size(); ++v) quads[v / 4][v % 4] = static_cast<Index>(v);
  const std::vector<double> separations(quads.size(), minimum_separation_m);
  std::atomic<bool> cancelled{false};
  const Deadline deadline = Deadline().orWhen(cancelled);
  PairBatch batch;
  batch.kind = kindOf(kind);
  batch.vertices = vertices.data();
  batch.pairs = quads.data();
  batch.count = quads.size();
  batch.minimum_separation_m = minimum_separation_m > 0 ? separations.data() : nullptr;
  batch.deadline = &deadline;
  std::vector<ElementaryResult> results(quads.size());
  const auto work = [&] {
    TierCounters counters;
    rung->run(batch, results.data(), counters);
  };
  runUnlocked(work, cancelBy(cancelled, quads.size() > SHORT_STEP));
  return rowsOf(results);
}

/// As many as the kind has; the others are NO_INDEX in a contact.
std::vector<Index> firstVertices(py::handle vertices, PairKind kind) {
  const Integers given = integersOf(vertices, "vertices", {ANY}, NO_INDEX);
  const py::ssize_t count = factsOf(kind).vertices[0] + factsOf(kind).vertices[1];
  if (given.size() >= count) return std::vector<Index>(given.data(), given.data() + count);
  throw py::value_error("vertices has " + std::to_string(given.size()) + "; " + toString(kind) + " has " +
                        std::to_string(count));
}

py::list linesOf(const std::vector<TraceLine>& trace) {
  py::list lines;
  for (const TraceLine& line : trace) {
    lines.append(py::make_tuple(line.part, line.stage, toString(line.says), line.text));
  }
  return lines;
}

py::list explainStep(py::handle bodies, py::handle kind_given, py::handle vertices, py::tuple whose, py::handle voxel,
                     py::handle voxels, const py::dict& options) {
  Step step;
  step.bodies = bodiesOf(bodies);
  step.map = mapOf(voxels);
  Options wanted;
  setOptions(options, step.bodies, wanted);
  std::vector<TraceLine> trace;
  const PairKind kind = kindOf(kind_given);
  const PairKindFacts& facts = factsOf(kind);
  const std::vector<Index> given = firstVertices(vertices, kind);
  PairQuestion question;
  question.kind = kind;
  question.vertex = given;
  for (std::size_t side = 0; side < (facts.isOnMap() ? 1 : 2); ++side) {
    question.body[side] = bodyOf(whose[side], step.bodies);
  }
  if (facts.isOnMap()) {
    if (voxel.is_none()) throw py::type_error(std::string("kind ") + facts.name + " needs a voxel's key");
    const Integers key = integersOf(voxel, "voxel", {3}, 65535);
    const std::int64_t* k = key.data();
    question.voxel = {static_cast<std::uint16_t>(k[0]), static_cast<std::uint16_t>(k[1]),
                      static_cast<std::uint16_t>(k[2])};
  }
  runUnlocked([&] { trace = explain(step, wanted, question); });
  return linesOf(trace);
}

py::tuple replayFile(const std::string& path, int threads) {
  StepRecording recording;
  StepReplay result;
  runUnlocked([&] {
    recording = readRecordingFile(path);
    result = replayStep(recording, threads);
  });
  const std::vector<Body>& bodies = recording.step.bodies;
  py::list shown;
  for (const Body& body : bodies) shown.append(py::cast(named(body, bodies)));
  const ObstacleMap& map = recording.step.map;
  const py::object voxels = map.surface ? py::cast(Voxels{map.surface, map.map_from_fixed, map.way}) : py::none();
  const py::object recorded =
      recording.has_answer ? py::cast(Answer(std::move(recording.answer))) : py::object(py::none());
  return py::make_tuple(Answer(std::move(result.answer)), recorded, result.differences, shown, voxels,
                        optionsOf(recording.options, bodies), recording.note);
}

const char* const HISTORY_DOC = R"(What lasts from one step to the next, for steps of the same bodies.

History()

Give the same one to each detect() of a sequence of steps: what was made of the meshes is made once, and where a step
begins exactly where the last one ended, what is known of that end is not looked for again. No answer changes, but for what detect() says.
Threads may share one; they then take turns.)";

}  // namespace

void runUnlocked(const std::function<void()>& work, const std::function<void()>& cancel) {
  if (!cancel) {
    const py::gil_scoped_release unlocked;
    return work();
  }
  std::exception_ptr interrupted;
  std::future<void> done;
  {
    const py::gil_scoped_release unlocked;
    done = std::async(std::launch::async, work);
    while (!interrupted && done.wait_for(LOOK_AT_SIGNALS) != std::future_status::ready) {
      const py::gil_scoped_acquire locked;
      if (PyErr_CheckSignals() == 0) continue;
      interrupted = std::make_exception_ptr(py::error_already_set());
      cancel();
    }
    done.wait();
  }
  if (interrupted) std::rethrow_exception(interrupted);
  done.get();
}

bool isLong(const std::vector<Body>& bodies, bool with_map) {
  std::size_t edges = 0;
  for (const Body& body : bodies) edges += body.topology->edges().size();
  return with_map || edges > SHORT_STEP;
}

void bindQuestions(py::module_& m) {
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      std::rethrow_exception(thrown);
    } catch (const RecordingError& error) {
      PyErr_SetString(PyExc_ValueError, error.what());
    }
  });
  bindClass<SharedHistory, std::shared_ptr<SharedHistory>>(m, "History", HISTORY_DOC)
      .def(py::init<>(), "__init__(self)\n--\n\nSee help(dccd.History).")
      .def(
          "clear",
          [](SharedHistory& shared) {
            const std::lock_guard<std::mutex> lock(shared.mutex);
            shared.history.clear();
          },
          py::call_guard<py::gil_scoped_release>(), "clear(self)\n--\n\nThe next step continues no other one.");
  m.def("detect", &detectStep, "detect(bodies, voxels, history, options)\n--\n\nFor dccd.detect().");
  m.def("pairs", &testPairs, "pairs(kind, t0, t1, minimum_separation_m, options)\n--\n\nFor dccd.pairs().");
  m.def("explain", &explainStep,
        "explain(bodies, kind, vertices, whose, voxel, voxels, options)\n--\n\nFor dccd.explain().");
  m.def("replay", &replayFile, "replay(path, threads)\n--\n\nFor dccd.replay().");
}

}  // namespace python
}  // namespace dccd
