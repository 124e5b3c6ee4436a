// check_step FRAME FRAME...: the contacts of the steps between mesh files of the same topology, or between the frames
// of an array. Ends with 0 when what it says is proved (contacts or none), with 3 when it is not, with 1 on an error.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>
#include <utility>

#include "apps/decimal_options.h"
#include "dccd/detect.h"
#include "dccd/monitor_extras.h"
#include "input/mesh_formats.h"
#include "input/npy_file.h"
#include "report/progress_bar.h"
#include "stream/quantile.h"

namespace {

using namespace dccd;

constexpr int NOT_PROVED = 3;  // CLI11 and this program's own errors have others

struct Arguments {
  std::vector<std::string> frames;
  std::string topology, contacts, stats;
  std::string accuracy = "exact", simd = "auto";
  int threads = 1, repeat = 1;
  bool no_start_state = false, earliest_only = false, forget = false;
};

Arguments parse(int argc, char** argv, CLI::App& app) {
  Arguments a;
  app.add_option(
         "FRAME", a.frames,
         "meshes with the same faces, two or more, each a step after the one before (.ply, .obj, .stl, .dae); or "
         ".npy of frames x vertices x 3")
      ->required()
      ->expected(1, -1);
  app.add_option("--topology", a.topology, "mesh file that has the faces, or the lines, of an .npy");
  app.add_option("--contacts", a.contacts, "write the contacts as CSV, of several steps with the step first, from 0");
  app.add_option("--stats", a.stats, "write pairs and milliseconds per stage as JSON");
  app.add_option("--accuracy", a.accuracy, "conservative or exact")->capture_default_str();
  app.add_option("--threads", a.threads, "worker threads")->capture_default_str();
  app.add_option("--repeat", a.repeat, "run the step this often for the times")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  app.add_option("--simd", a.simd, "SIMD target, or auto")->capture_default_str();
  app.add_flag("--no-start-state", a.no_start_state, "leave out whether surfaces cross at t=0: then nothing is proved");
  app.add_flag("--earliest-only", a.earliest_only, "only the first contacts");
  app.add_flag("--forget", a.forget, "of several steps: nothing is kept of bodies at rest; no answer changes");
  requireDecimalNumbers(app);
  app.parse(argc, argv);
  return a;
}

/// Of several steps a column says which one.
void writeContacts(const std::string& path, const std::vector<std::vector<Contact>>& steps) {
  std::ofstream out(path);
  const bool sequence = steps.size() > 1;
  out << (sequence ? "step," : "") << "kind,v0,v1,v2,v3,toc_lower,toc_upper,certainty\n" << std::setprecision(17);
  for (std::size_t step = 0; step < steps.size(); ++step) {
    // Rows sorted as integers: kind VF before EE, then the vertices. The detector's order is that already.
    for (const Contact& c : steps[step]) {
      if (sequence) out << step << ',';
      out << factsOf(c.kind).short_name;
      for (Index v : c.vertex) out << ',' << v;
      out << ',' << c.toc_lower << ',' << c.toc_upper << ','
          << (c.certainty == Certainty::CERTAIN ? "certain" : "undecided") << '\n';
    }
  }
  out.close();
  if (!out) throw std::runtime_error(path + ": cannot be written");
}

struct Times {
  std::vector<double> ms;
  double best() const { return *std::min_element(ms.begin(), ms.end()); }
  double median() const { return quantile(ms, 0.5); }
  double mean() const { return std::accumulate(ms.begin(), ms.end(), 0.0) / static_cast<double>(ms.size()); }
  nlohmann::json json() const { return {{"best", best()}, {"median", median()}, {"mean", mean()}}; }
};

/// The answers to the steps, as often as they were run.
struct Run {
  Options options;
  History history;
  Outcome result;           // of the last step
  Assurance assurance;      // of the first step that is not proved, or the last one; what touches in any
  double earliest_toc = 0;  // steps after the first frame
  StepStats sum;            // over the steps
  std::vector<std::vector<Contact>> contacts;  // per step
  std::map<std::string, Times> times;

  std::size_t contactCount() const {
    std::size_t n = 0;
    for (const std::vector<Contact>& step : contacts) n += step.size();
    return n;
  }
  void once(const std::vector<Step>& steps, ProgressBar& progress) {
    contacts.clear();
    sum = StepStats();
    earliest_toc = std::numeric_limits<double>::infinity();
    Touching touching = Touching::NONE;  // nothing is expected here, so that the largest is the worst
    if (steps.size() > 1) history.clear();
    for (const Step& step : steps) {
      result = detect(step, options, history);
      contacts.push_back(result.contacts);
      sum += result.stats;
      for (std::size_t s = 0; s < result.stats.stages.size(); ++s) {
        times[toString(static_cast<Stage>(s))].ms.push_back(result.stats.stages[s].ms);
      }
      times["total"].ms.push_back(result.stats.total_ms);
      const Assurance of_step = assuranceOf(result);
      touching = std::max(touching, of_step.touching);
      if (contacts.size() == 1 || assurance.proved) assurance = of_step;
      if (result.earliest_toc <= 1) {
        earliest_toc = std::min(earliest_toc, static_cast<double>(contacts.size() - 1) + result.earliest_toc);
      }
      progress.advance();
    }
    assurance.touching = touching;
  }
};

Options optionsOf(const Arguments& a, bool is_sequence) {
  Options options;
  options.keep_bounds = is_sequence && !a.forget;  // else the same step again and again
  options.accuracy.rung = accuracyFromString(a.accuracy.c_str());
  options.num_threads = a.threads;
  options.earliest_only = a.earliest_only;
  options.check_start_state = !a.no_start_state;
  return options;
}

nlohmann::json statsJson(const Arguments& a, const Run& run) {
  nlohmann::json j;
  for (std::size_t s = 0; s < run.sum.stages.size(); ++s) {
    const StageStats& stage = run.sum.stages[s];
    j["pairs"][toString(static_cast<Stage>(s))] = {{"in", stage.in}, {"out", stage.out}};
  }
  for (const auto& [name, times] : run.times) j["ms"][name] = times.json();
  for (std::size_t t = 0; t < run.sum.tiers.settled.size(); ++t) {
    j["tiers"][toString(static_cast<Tier>(t))] = run.sum.tiers.settled[t];
  }
  j["steps"] = run.contacts.size();
  for (const StepCounter& counter : STEP_COUNTERS) j[counter.name] = run.sum.*counter.value;
  j["threads"] = a.threads;
  j["simd_target"] = simdTarget();
  j["accuracy"] = a.accuracy;
  j["contacts"] = run.contactCount();
  // Of all steps; then of the last.
  j["proved"] = run.assurance.proved;
  j["missing"] = run.assurance.missing;
  j["touching"] = toString(run.assurance.touching);
  j["complete"] = run.result.allPairs();
  j["start_state"] = toString(run.result.start_state);
  j["start_state_complete"] = run.result.start_state_complete;
  if (!run.result.allPairs()) j["unchecked_toc_lower"] = run.result.unchecked_toc_lower;
  return j;
}

void print(const Arguments& a, const Run& run) {
  std::cout << std::left << std::setw(14) << "accuracy" << std::right << std::setw(10) << "contacts" << std::setw(11)
            << "undecided" << std::setw(14) << "earliest toc" << std::setw(11) << "best ms" << std::setw(11)
            << "median ms" << '\n';
  std::cout << std::left << std::setw(14) << a.accuracy << std::right << std::setw(10) << run.contactCount()
            << std::setw(11) << run.sum.undecided << std::setw(14);
  if (std::isfinite(run.earliest_toc))
    std::cout << run.earliest_toc;
  else
    std::cout << "none";
  std::cout << std::fixed << std::setprecision(2) << std::setw(11) << run.times.at("total").best() << std::setw(11)
            << run.times.at("total").median() << std::defaultfloat << std::setprecision(6) << '\n';
}

void hint(const std::string& path, const std::string& text) {
  std::cerr << "check_step: " << path << ": " << text << '\n';
}

std::string sizesOf(const MeshFile& frame) {
  const std::string parts = frame.edges.empty() ? std::to_string(frame.polygons.size()) + " faces"
                                                : std::to_string(frame.edges.size()) + " edges of lines";
  return std::to_string(frame.positions.size()) + " vertices and " + parts;
}

/// A name without its numbers, and these: how many digits, without zeros before them, and which.
struct NumberedName {
  std::string text;
  std::vector<std::pair<std::size_t, std::string>> numbers;

  explicit NumberedName(const std::string& name) {
    const auto isDigit = [](char c) { return c >= '0' && c <= '9'; };
    for (auto at = name.begin(); at != name.end();) {
      const auto end = std::find_if_not(at, name.end(), isDigit);
      if (end == at) {
        text += *at++;
        continue;
      }
      text += '0';
      const std::string digits(std::find_if(at, end, [](char c) { return c != '0'; }), end);
      numbers.emplace_back(digits.size(), digits);
      at = end;
    }
  }
};

/// A shell has 10.obj before 2.obj. Whoever names frames that go neither up nor down means another order.
void requireOrder(const std::vector<std::string>& paths) {
  if (std::set<std::string>(paths.begin(), paths.end()).size() < paths.size()) return;
  const std::vector<NumberedName> names(paths.begin(), paths.end());
  const auto isOther = [&](const NumberedName& name) { return name.text != names[0].text; };
  if (std::any_of(names.begin(), names.end(), isOther)) return;
  const auto isLess = [](const NumberedName& a, const NumberedName& b) { return a.numbers < b.numbers; };
  const auto descent = std::is_sorted_until(names.begin(), names.end(), isLess);
  if (descent == names.end() || std::is_sorted(names.rbegin(), names.rend(), isLess)) return;
  const auto at = static_cast<std::size_t>(descent - names.begin());
  throw std::runtime_error(paths[at - 1] + " stands before " + paths[at] +
                           ": the numbers in the names go neither up nor down; give the frames in their order, as by "
                           "$(ls -v ...)");
}

std::vector<MeshFile> framesOf(const std::vector<std::string>& paths) {
  std::vector<MeshFile> frames;
  for (const std::string& path : paths) {
    frames.push_back(loadMeshFile(path));
    const MeshFile &first = frames.front(), &next = frames.back();
    if (first.is_soup != next.is_soup) {
      throw std::runtime_error(path + ": of it and " + paths[0] +
                               " just one numbers its vertices (OBJ, PLY); write all frames in one format");
    }
    const bool same = first.is_soup ? first.polygons.ends == next.polygons.ends
                                    : first.positions.size() == next.positions.size() &&
                                          first.polygons == next.polygons && first.edges == next.edges;
    if (!same) {
      throw std::runtime_error(path + ": not the topology of " + paths[0] + " (" + sizesOf(next) + ", expected " +
                               sizesOf(first) + ", the same ones)");
    }
  }
  if (const std::size_t apart = frames[0].is_soup ? matchSoups(frames) : 0; apart > 0) {
    hint(paths[0], std::to_string(apart) +
                       " vertices come apart in a later frame: their corners are vertices of their own, which touch "
                       "where they are equal; write OBJ or PLY if they are to be one");
  }
  for (std::size_t i = 0; i < paths.size(); ++i) {
    for (const std::string& text : frames[i].hints) hint(paths[i], text);
  }
  return frames;
}

bool isArray(const std::string& path) { return fileEnding(path) == "npy"; }

/// Arrays have positions alone: all else is the topology's.
std::vector<MeshFile> framesOfArrays(const Arguments& a) {
  const auto other = std::find_if_not(a.frames.begin(), a.frames.end(), isArray);
  if (other != a.frames.end()) {
    throw std::runtime_error(*other + ": is no .npy; --topology gives faces to arrays, and frames are all of one kind");
  }
  if (a.topology.empty()) {
    throw std::runtime_error(a.frames[0] + ": an array has no faces; name a mesh file of these vertices by --topology");
  }
  MeshFile mesh = loadMeshFile(a.topology);
  if (mesh.is_soup) throw std::runtime_error(a.topology + ": does not number its vertices; take an OBJ or PLY");
  for (const std::string& text : mesh.hints) hint(a.topology, text);
  std::vector<MeshFile> frames;
  for (const std::string& path : a.frames) {
    for (Positions& positions : loadNpyFrames(path)) {
      if (positions.size() != mesh.positions.size()) {
        throw std::runtime_error(path + ": has " + std::to_string(positions.size()) + " vertices, and " + a.topology +
                                 " has " + std::to_string(mesh.positions.size()));
      }
      mesh.positions = std::move(positions);
      frames.push_back(frames.empty() ? mesh : MeshFile());
      frames.back().positions = mesh.positions;
    }
  }
  return frames;
}

/// The edges of ropes. Two ends that are at one place in every frame are one vertex, the first of them: else the edges
/// on either side of a point that repeats would touch there.
std::vector<Edge> edgesOf(const std::vector<MeshFile>& frames) {
  std::vector<Index> first(frames[0].positions.size());
  std::iota(first.begin(), first.end(), Index(0));
  const auto firstOf = [&](Index v) {
    while (first[v] != v) v = first[v];
    return v;
  };
  for (const Edge& edge : frames[0].edges) {
    const auto isOne = [&](const MeshFile& frame) { return frame.positions[edge[0]] == frame.positions[edge[1]]; };
    if (!std::all_of(frames.begin(), frames.end(), isOne)) continue;
    const auto [low, high] = std::minmax({firstOf(edge[0]), firstOf(edge[1])});
    first[high] = low;
  }
  std::vector<Edge> edges;
  for (const Edge& edge : frames[0].edges) {
    const Index a = firstOf(edge[0]), b = firstOf(edge[1]);
    if (a != b) edges.push_back({a, b});
  }
  return edges;
}

std::vector<Step> stepsOf(const Arguments& a) {
  const bool has_arrays = !a.topology.empty() || std::any_of(a.frames.begin(), a.frames.end(), isArray);
  const std::vector<MeshFile> frames = has_arrays ? framesOfArrays(a) : framesOf(a.frames);
  if (frames.size() < 2) throw std::runtime_error(a.frames[0] + ": is one frame; a step needs two");
  const MeshFile& first = frames[0];
  Step step;
  step.bodies.resize(1);
  step.bodies[0].name = a.frames[0];
  step.bodies[0].topology = share(first.edges.empty() ? Topology::fromTriangles(first.positions.size(), first.faces)
                                                      : Topology::fromEdges(first.positions.size(), edgesOf(frames)));
  step.bodies[0].dropped_faces = first.uncheckedCount();
  step.bodies[0].t1 = share(first.positions);
  std::vector<Step> steps;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    step.bodies[0].t0 = step.bodies[0].t1;
    step.bodies[0].t1 = share(frames[i].positions);
    steps.push_back(step);
  }
  return steps;
}

int checkStep(const Arguments& a) {
  for (const std::string& frame : a.frames) refuseToOverwrite(frame, {a.contacts, a.stats});
  refuseToOverwrite(a.topology, {a.contacts, a.stats});
  requireOrder(a.frames);
  setSimdTarget(a.simd);
  const std::vector<Step> steps = stepsOf(a);
  Run run;
  run.options = optionsOf(a, steps.size() > 1);
  {
    ProgressBar progress("steps", static_cast<std::size_t>(a.repeat) * steps.size());
    for (int i = 0; i < a.repeat; ++i) run.once(steps, progress);
  }
  print(a, run);
  if (!a.contacts.empty()) writeContacts(a.contacts, run.contacts);
  std::cout << a.accuracy << ": " << describe(run.assurance) << '\n';
  if (!a.stats.empty()) {
    std::ofstream out(a.stats);
    out << statsJson(a, run).dump(2) << '\n';
    out.close();
    if (!out) throw std::runtime_error(a.stats + ": cannot be written");
  }
  return run.assurance.proved ? 0 : NOT_PROVED;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Contacts of the steps between meshes of the same topology"};
  app.footer("Exit status: 0 when the answer is proved, with contacts or without; 3 when it is not; 1 on an error.");
  try {
    return checkStep(parse(argc, argv, app));
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 1;
  } catch (const std::exception& e) {
    std::cerr << "check_step: " << e.what() << '\n';
    return 1;
  }
}
