// analyze_bag IN.bag... [-o OUT.bag] --report DIR: a recorded run through the same core as the node's, without a
// master.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <memory>
#include <numeric>
#include <sstream>

#include "apps/analyze_bag/result_bag.h"
#include "apps/analyze_bag/study_runner.h"
#include "apps/decimal_options.h"
#include "dccd/monitor_extras.h"
#include "node/bag_pieces.h"
#include "node/bag_replay.h"
#include "node/robot_source.h"
#include "report/report.h"
#include "stream/quantile.h"

namespace {

using namespace dccd;

constexpr int ERROR = 1, NOT_PROVED = 3;
#ifdef __clang__
#define COMPILER __VERSION__  // names Clang itself
#else
#define COMPILER "g++ " __VERSION__
#endif

struct Arguments {
  std::vector<std::string> bags;
  std::string out, report, params, octomap, tf_static, accuracy, mesh, robot, command,
      intended = BagReplayOptions().intended_topic;
  double look_ahead_s = 0;
  int threads = 0;
  bool without_map = false, study = false, quiet = false, pieces = false;
};

MonitorConfig configure(const Arguments& a) {
  ParameterTree tree;
  if (!a.params.empty()) tree = readYaml(a.params);
  if (!a.mesh.empty()) {
    if (tree.has("bodies")) {
      throw ParameterError("--mesh has no place beside the bodies of " + a.params + "; set bodies/NAME/topic there");
    }
    tree.put("topic", a.mesh);
  } else if (!tree.has("bodies") && !tree.has("topic")) {
    ParameterTree copy = tree;
    std::vector<std::string> clouds{copy.members["obstacle_cloud_topic"].text};
    for (ParameterTree& one : copy.members["obstacle_cloud_topics"].items) {
      clouds.push_back(one.kind == ParameterTree::Kind::TEXT ? one.text : one.members["topic"].text);
    }
    const std::string topic = BagReplay::firstMeshTopic(a.bags, clouds);
    if (!topic.empty()) tree.put("topic", topic);
  }
  if (a.without_map) {
    ParameterTree effects = tree.has("effects") ? tree.members["effects"] : ParameterTree();
    effects.put("octomap", "off");
    tree.put("effects", std::move(effects));
  }
  if (!a.accuracy.empty()) tree.put("accuracy", a.accuracy);
  if (a.look_ahead_s > 0) tree.put("look_ahead_s", a.look_ahead_s);
  if (a.threads > 0) tree.put("num_threads", a.threads);
  if (!a.robot.empty()) {
    ParameterTree robot = tree.has("robot") ? tree.members["robot"] : ParameterTree();
    if (robot.kind == ParameterTree::Kind::TEXT) robot = ParameterTree();
    robot.put("description", a.robot);
    tree.put("robot", std::move(robot));
  }
  return readConfig(tree, a.params.empty() ? "--" : "", robotOfFiles());
}

std::string seconds(double s) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(3) << s << " s";
  return text.str();
}

std::string lookAheadLine(const BagReplaySummary& summary) {
  if (!summary.look_ahead) return "";
  const LookAheadSummary& s = *summary.look_ahead;
  std::ostringstream text;
  text << "look-ahead: " << s.came_true << " predictions came true, " << s.not_observed << " were not observed, "
       << s.not_predicted << " contacts not predicted\n";
  return text.str();
}

/// Empty: there were none.
std::string promisesInWords(const BagReplaySummary& summary) {
  const PromiseCounts& promises = summary.promises;
  if (promises.made == 0) return "";
  std::ostringstream text;
  text << "safe until: " << promises.made << (promises.made == 1 ? " promise of " : " promises of ")
       << quantile(summary.promised_s, 0.5) << " s in the middle, " << promises.kept << " kept, " << promises.broken
       << " void, " << promises.unseen() << " not looked at"
       << (summary.first_broken.empty() ? "" : "; the first that was void: ") << summary.first_broken;
  return text.str();
}

/// Its name, and in the lines after it what is in it.
std::string textOf(const std::string& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << file << '\n' << in.rdbuf();
  return text.str();
}

/// As a shell would take it again.
std::string commandLine(int argc, char** argv) {
  std::string line;
  for (int i = 0; i < argc; ++i) {
    std::string word = i == 0 ? std::filesystem::path(argv[0]).filename().string() : argv[i];
    const char* const plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./=:,+@%";
    if (word.empty() || word.find_first_not_of(plain) != std::string::npos) {
      for (std::size_t at = 0; (at = word.find('\'', at)) != std::string::npos; at += 4) word.replace(at, 1, "'\\''");
      word = "'" + word + "'";
    }
    line += (i > 0 ? " " : "") + word;
  }
  return line;
}

/// Where the map came from; that there was none is not to be read as if it had been used.
std::string mapUsed(const BagReplaySummary& summary) {
  return summary.map_source == "off" || summary.maps > summary.maps_refused ? summary.map_source
                                                                            : "none on " + summary.map_source;
}

/// What the page's head says of the run.
void describe(const Arguments& a, const MonitorConfig& config, const BagReplaySummary& summary, Report& report) {
  report.setEffects(summary.effects.decisions());
  report.setPromises(promisesInWords(summary));
  if (summary.look_ahead) report.setLookAhead(*summary.look_ahead, config.monitor.look_ahead_s);
  report.setCounters(summary.frames);
  std::string topics;
  for (const std::string& t : summary.mesh_topics) topics += (topics.empty() ? "" : ", ") + (t.empty() ? "(rigid)" : t);
  std::string bags;
  for (const std::string& bag : a.bags) bags += (bags.empty() ? "" : ", ") + bag;
  std::vector<std::pair<std::string, std::string>> facts{
      {"bag", bags},
      {"command", a.command},
      {"program", "deformable_ccd " DEFORMABLE_CCD_VERSION ", compiled by " COMPILER},
      {"parameters", a.params.empty() ? "the defaults, and what the command says" : textOf(a.params)},
      {"mesh topics", topics},
      {"fixed frame", summary.fixed_frame},
      {"duration", seconds(summary.duration_s)},
      {"mesh messages", std::to_string(summary.mesh_messages)},
      {"octomap", mapUsed(summary)},
      {"maps", std::to_string(summary.maps) + " (" + std::to_string(summary.maps_refused) + " refused)"},
      {"accuracy", toString(config.monitor.detector.accuracy.rung)},
      {"threads", std::to_string(config.monitor.detector.num_threads)},
      {"SIMD target", simdTarget()}};
  for (const std::string& sentence : summary.not_looked_at) facts.push_back({"not looked at", sentence});
  for (const std::string& c : summary.problems) facts.push_back({"complaint", c});
  report.setNotLookedAt(summary.not_looked_at);
  report.setDoubts(summary.doubts);
  report.setUnansweredEnd(summary.unanswered_end);
  report.setFacts(std::move(facts));
}

/// Says what came of it; the exit status.
int conclude(const Arguments& a, const BagReplaySummary& summary, const Report& report, bool answered,
             const std::string& of_study = "") {
  const std::string promises = promisesInWords(summary);
  // Why it is not proved is said once: in the last line of the errors.
  std::cout << report.headline(false) << '\n'
            << "frames: " << summary.frames.received << " received, " << summary.frames.processed() << " processed, "
            << summary.frames.started() << " started a pair, " << summary.frames.skipped() << " skipped\n"
            << lookAheadLine(summary) << promises << (promises.empty() ? "" : "\n") << of_study
            << "octomap: " << mapUsed(summary) << '\n'
            << "report: " << a.report << "/report.html\n";
  for (const std::string& sentence : summary.not_looked_at) std::cout << "note: " << sentence << '\n';
  for (const std::string& sentence : summary.doubts) std::cout << "in doubt: " << sentence << '\n';
  const std::string unproved = report.unproved();
  std::string said = std::accumulate(summary.not_looked_at.begin(), summary.not_looked_at.end(), unproved);
  said = std::accumulate(summary.doubts.begin(), summary.doubts.end(), said);
  for (const std::string& c : summary.problems) {
    const std::string refused = "refused: ";
    const std::size_t at = c.find(refused);
    const std::string reason = at == std::string::npos ? c : c.substr(at + refused.size());
    if (said.find(reason) == std::string::npos) std::cerr << "analyze_bag: " << c << '\n';
  }
  if (unproved.empty()) return 0;
  std::cerr << "analyze_bag: " << (answered ? "not proved: " : "no frame was answered: ") << unproved << '\n';
  return NOT_PROVED;
}

/// Of a run with `intent` and `speed_scale`.
std::optional<SpeedScales> scalesOf(const Outcome& outcome, const MonitorPipeline& pipeline, const ros::Time& at) {
  if (!pipeline.config().speed_law || !pipeline.config().intent) return std::nullopt;
  const AlongPath& along = pipeline.intended().along;
  const double said = speedScaleAt(outcome, pipeline, at).scale;
  return SpeedScales{said, along.unused.empty() ? std::min(said, along.scale_by_bounds) : said};
}

int analyze(const Arguments& a) {
  for (const std::string& bag : a.bags) refuseToOverwrite(bag, {a.out});
  for (const std::string& input : {a.params, a.octomap, a.robot, a.tf_static}) refuseToOverwrite(input, {a.out});
  const MonitorConfig config = configure(a);
  BagReplayOptions options;
  options.octomap_file = a.octomap;
  options.tf_static_file = a.tf_static;
  options.intended_topic = a.intended;
  options.show_progress = !a.quiet;
  BagReplay replay(a.bags, config, options);
  Report report(a.report);  // makes the folder, in which the results may lie, too
  std::unique_ptr<ResultBag> out =
      a.out.empty() ? nullptr : std::make_unique<ResultBag>(a.out, replay.lentTransforms(), bagTopic(a.intended));
  bool answered = false;
  const BagReplaySummary summary = replay.run(
      [&](const Outcome& outcome, MonitorPipeline& pipeline, const BagReplaySummary& so_far, const ros::Time& at) {
        const std::vector<Body>& bodies = pipeline.monitor().bodies();
        report.add(outcome, bodies, static_cast<std::int64_t>(at.toNSec()), bodies[config.monitor.clock_body].name,
                   scalesOf(outcome, pipeline, at));
        answered = answered || outcome.answered;
        if (out) out->add(outcome, pipeline, so_far, at);
      },
      [&](const rosbag::MessageInstance& m, const MonitorPipeline& pipeline, const BagReplaySummary& so_far) {
        if (out) out->copy(m, pipeline, so_far);
      },
      [&](const Outcome& prediction, MonitorPipeline& pipeline, const BagReplaySummary&, const ros::Time& at) {
        if (out) out->addPrediction(prediction, pipeline, at);
      },
      [&](const Outcome& outcome, MonitorPipeline& pipeline, const BagReplaySummary&, const ros::Time& at) {
        if (out) out->addAhead(outcome, pipeline, at);
      });
  if (out) out->close();
  describe(a, config, summary, report);
  report.finish();
  std::string study_line;
  if (a.study) {  // takes long, and what there is should not be lost with it
    out.reset();
    const AccuracyStudy study = runStudy(a.bags, config, options);
    study.write(a.report + "/study.csv");
    report.setStudy(study.json());
    report.finish();
    study_line = "what accuracy costs: " + study.sentence() + '\n';
  }
  return conclude(a, summary, report, answered, study_line);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Contacts of a recorded run, with a report"};
  Arguments a;
  app.add_option("BAG", a.bags, "bag to analyse; several: the pieces of one run, as by rosbag record --split")
      ->required()
      ->check(CLI::ExistingFile);
  app.add_option("-o,--output", a.out, "write a bag with the input and the results");
  auto* report = app.add_option("--report", a.report, "folder for the report");
  app.add_option("--params", a.params, "YAML file with the node's parameters")->check(CLI::ExistingFile);
  app.add_option("--mesh", a.mesh,
                 "mesh topic, in place of the parameters'; the first one of the bag if neither names one");
  app.add_option("--robot", a.robot, "URDF file of a robot, whose links tf carries")->check(CLI::ExistingFile);
  auto* octomap =
      app.add_option("--octomap", a.octomap, ".bt or .ot file instead of the bag's maps")->check(CLI::ExistingFile);
  app.add_option("--tf-static", a.tf_static, "bag whose /tf_static holds for frames that have none in the others")
      ->check(CLI::ExistingFile);
  app.add_option("--intended", a.intended, "the bag's ~intended, where the parameters have intent")
      ->capture_default_str();
  app.add_flag("--without-map", a.without_map, "do without the map, also where the parameters call for one")
      ->excludes(octomap);
  app.add_option("--accuracy", a.accuracy, "exact, or conservative for distances");
  app.add_option("--threads", a.threads, "worker threads of a step")->check(CLI::Range(1, 256));
  app.add_option("--look-ahead", a.look_ahead_s, "horizon of predictions [s], compared with what is observed later")
      ->check(CLI::Range(0.0, 3600.0));
  app.add_flag("--accuracy-study", a.study,
               "run the bag with fewer frames, vertices and voxels, other rungs and noise, and say what each "
               "does to first contacts");
  app.add_flag("--quiet", a.quiet, "no progress");
  app.add_flag("--list-pieces", a.pieces, "only say, as JSON, which of the bags are pieces of one run")
      ->excludes(report);
  app.footer(
      "Exit status:\n"
      "  0  every step is proved: what does not touch is known not to\n"
      "  1  an error, and a line that says which\n"
      "  3  answered, but not all of it is proved, or no frame was answered; a line says why");
  try {
    requireDecimalNumbers(app);
    app.parse(argc, argv);
    if (a.pieces) {
      std::cout << nlohmann::json(groupedByRun(a.bags)) << '\n';
      return 0;
    }
    if (report->empty()) throw CLI::RequiredError("--report");
    a.command = commandLine(argc, argv);
    return analyze(a);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : ERROR;
  } catch (const std::exception& e) {
    std::cerr << "analyze_bag: " << e.what() << '\n';
    return ERROR;
  }
}
