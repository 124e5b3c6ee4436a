// run_queries DIR...: hard queries in; wrong answers, time per query and error of the TOC out, for each rung.
//
// Time per query: one pair per call; the best of 5 repeats, each long enough (about a microsecond) for the clock; then
// the statistics over the queries. Errors of the TOC are against the exact oracle (oracle/oracle.h).
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <map>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "apps/decimal_options.h"
#include "base/accuracy.h"
#include "dccd/elementary.h"
#include "oracle/oracle.h"
#include "oracle/promises.h"
#include "oracle/query_file.h"
#include "stream/quantile.h"

namespace dccd {
namespace {

using Clock = std::chrono::steady_clock;

/// What one rung did on one family and kind.
struct Row {
  std::size_t queries = 0, contacts = 0, false_negatives = 0, false_positives = 0, undecided = 0;
  double max_toc_error = 0;
  std::vector<double> nanoseconds;

  Row& operator+=(const Row& other) {
    queries += other.queries;
    contacts += other.contacts;
    false_negatives += other.false_negatives;
    false_positives += other.false_positives;
    undecided += other.undecided;
    max_toc_error = std::max(max_toc_error, other.max_toc_error);
    nanoseconds.insert(nanoseconds.end(), other.nanoseconds.begin(), other.nanoseconds.end());
    return *this;
  }
};

struct JudgedRung {
  AccuracyOptions options;
  std::unique_ptr<Rung> test;
};

/// A query in the form that the rungs take.
struct Pair {
  VertexMotion vertices[4] = {};
  Quad quad = {0, 1, 2, 3};
  PairBatch batch;
  explicit Pair(const Query& query) {
    for (int i = 0; i < 4; ++i) {
      std::memcpy(vertices[i].t0, query.motion.x[0][i], sizeof query.motion.x[0][i]);
      std::memcpy(vertices[i].t1, query.motion.x[1][i], sizeof query.motion.x[1][i]);
    }
    batch.kind = query.kind;
    batch.vertices = vertices;
    batch.pairs = &quad;
    batch.count = 1;
  }
};

double nanosecondsOf(const Rung& test, const Pair& pair, int calls, ElementaryResult& result) {
  TierCounters counters;
  const Clock::time_point begin = Clock::now();
  for (int i = 0; i < calls; ++i) test.run(pair.batch, &result, counters);
  return std::chrono::duration<double, std::nano>(Clock::now() - begin).count() / calls;
}

double bestNanoseconds(const Rung& test, const Pair& pair, ElementaryResult& result) {
  constexpr int REPEATS = 5;
  constexpr double SAMPLE_NS = 1000;
  const double once = nanosecondsOf(test, pair, 1, result);
  const int calls = std::max(1, std::min(64, static_cast<int>(SAMPLE_NS / std::max(once, 1.0)) + 1));
  double best = once;
  for (int i = 0; i < REPEATS; ++i) best = std::min(best, nanosecondsOf(test, pair, calls, result));
  return best;
}

void tally(const Query& query, std::optional<test::Root>& toc, const ElementaryResult& result, Row& row) {
  ++row.queries;
  row.contacts += query.contact;
  row.false_negatives += query.contact && result.verdict == Verdict::NO_CONTACT;
  row.false_positives += !query.contact && result.verdict == Verdict::CONTACT;
  row.undecided += result.verdict == Verdict::UNDECIDED;
  if (toc && result.verdict != Verdict::NO_CONTACT) {
    row.max_toc_error = std::max(row.max_toc_error, std::abs(test::tocError(*toc, result.toc_lower)));
  }
}

using RowKey = std::pair<std::string, PairKind>;

/// Runs all rungs on all queries below the folders, collecting complaints on stderr.
class Runner {
 public:
  explicit Runner(const std::vector<JudgedRung>& rungs) : rungs_(rungs) {}

  void runFolder(const std::string& dir) {
    const std::vector<QueryFileEntry> files = findQueryFiles(dir);
    if (files.empty()) throw std::runtime_error(dir + ": no .csv file in a folder vertex-face or edge-edge");
    for (const QueryFileEntry& file : files) runFile(file);
  }

  const std::map<RowKey, std::vector<Row>>& rows() const { return rows_; }
  std::size_t complaints() const { return complaints_; }

 private:
  void runFile(const QueryFileEntry& file) {
    std::vector<Row>& rows = rows_[{file.family, file.kind}];
    rows.resize(rungs_.size());
    const std::vector<Query> queries = readQueryFile(file.path, file.kind);
    for (std::size_t index = 0; index < queries.size(); ++index) {
      const Query& query = queries[index];
      const auto complain = [&](const std::string& what) {
        ++complaints_;
        std::cerr << file.path << ": query " << index << ": " << what << "\n";
      };
      std::optional<test::Root> toc = test::firstContact(query.kind, query.motion);
      if (toc.has_value() != query.contact) complain("the truth column is not the oracle's verdict");
      const Pair pair(query);
      for (std::size_t i = 0; i < rungs_.size(); ++i) {
        ElementaryResult result;
        rows[i].nanoseconds.push_back(bestNanoseconds(*rungs_[i].test, pair, result));
        tally(query, toc, result, rows[i]);
        const std::string broken = test::brokenPromise(rungs_[i].options, query, toc, result);
        if (!broken.empty()) complain(std::string(toString(rungs_[i].options.rung)) + ": " + broken);
      }
    }
  }

  const std::vector<JudgedRung>& rungs_;
  std::map<RowKey, std::vector<Row>> rows_;
  std::size_t complaints_ = 0;
};

std::vector<JudgedRung> makeRungs(const AccuracyOptions& options) {
  std::vector<JudgedRung> rungs;
  for (const Accuracy each : allRungs()) {
    JudgedRung rung;
    rung.options = options;
    rung.options.rung = each;
    rung.test = makeRung(rung.options);
    rungs.push_back(std::move(rung));
  }
  return rungs;
}

constexpr const char* COLUMNS[] = {
    "family",    "kind",    "rung",      "queries", "contacts", "false_negatives", "false_positives",
    "undecided", "mean_ns", "median_ns", "p99_ns",  "max_ns",   "max_toc_error"};

std::string formatted(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

/// The cells of a row.
std::vector<std::string> cellsOf(const std::string& family, const std::string& kind, const JudgedRung& rung,
                                 const Row& row) {
  std::vector<std::string> cells = {family, kind, toString(rung.options.rung)};
  for (std::size_t count : {row.queries, row.contacts, row.false_negatives, row.false_positives, row.undecided}) {
    cells.push_back(std::to_string(count));
  }
  const double mean = std::accumulate(row.nanoseconds.begin(), row.nanoseconds.end(), 0.0) / row.queries;
  cells.push_back(formatted("%.1f", mean));
  for (const double q : {0.5, 0.99, 1.0}) cells.push_back(formatted("%.1f", quantile(row.nanoseconds, q)));
  cells.push_back(formatted("%.3g", row.max_toc_error));
  return cells;
}

using Cells = std::vector<std::vector<std::string>>;

/// A row per family, kind and rung; for the table also one over everything per rung.
Cells makeCells(const std::vector<JudgedRung>& rungs, const std::map<RowKey, std::vector<Row>>& rows, bool with_total) {
  Cells cells = {{std::begin(COLUMNS), std::end(COLUMNS)}};
  std::vector<Row> total(rungs.size());
  for (const auto& [key, per_rung] : rows) {
    for (std::size_t i = 0; i < rungs.size(); ++i) {
      if (per_rung[i].queries == 0) continue;
      cells.push_back(cellsOf(key.first, queryFolder(key.second), rungs[i], per_rung[i]));
      total[i] += per_rung[i];
    }
  }
  for (std::size_t i = 0; with_total && i < rungs.size(); ++i) {
    if (total[i].queries > 0) cells.push_back(cellsOf("(all)", "(both)", rungs[i], total[i]));
  }
  return cells;
}

std::string csvCell(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted_text = "\"";
  for (char c : text) quoted_text += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted_text + "\"";
}

void printCsv(const Cells& cells) {
  for (const std::vector<std::string>& row : cells) {
    for (std::size_t i = 0; i < row.size(); ++i) std::cout << (i > 0 ? "," : "") << csvCell(row[i]);
    std::cout << '\n';
  }
}

void printTable(const Cells& cells) {
  constexpr std::size_t TEXT_COLUMNS = 3;
  std::vector<std::size_t> width(cells[0].size());
  for (const auto& row : cells) {
    for (std::size_t i = 0; i < row.size(); ++i) width[i] = std::max(width[i], row[i].size());
  }
  for (const auto& row : cells) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string padding(width[i] - row[i].size(), ' ');
      std::cout << (i > 0 ? "  " : "") << (i < TEXT_COLUMNS ? row[i] + padding : padding + row[i]);
    }
    std::cout << '\n';
  }
}

int runQueries(const std::vector<std::string>& dirs, const AccuracyOptions& options, bool as_csv) {
  const std::vector<JudgedRung> rungs = makeRungs(options);
  Runner runner(rungs);
  for (const std::string& dir : dirs) runner.runFolder(dir);
  const Cells cells = makeCells(rungs, runner.rows(), !as_csv);
  as_csv ? printCsv(cells) : printTable(cells);
  if (runner.complaints() > 0) std::cerr << runner.complaints() << " complaints, see above\n";
  return runner.complaints() > 0 ? 1 : 0;
}

}  // namespace
}  // namespace dccd

int main(int argc, char** argv) {
  CLI::App app{
      "Runs hard queries: wrong answers, time per query and error of the time of contact for each rung.\n"
      "DIR holds FAMILY/{vertex-face,edge-edge}/*.csv, or is one such family. 'contacts' are the true ones;\n"
      "max_toc_error is in steps, against exact arithmetic. Exit status: 0 every promise kept, 1 one broken\n"
      "or a truth column wrong (listed on stderr), 2 bad input."};
  std::vector<std::string> dirs;
  std::string format = "table";
  dccd::AccuracyOptions options;
  app.add_option("DIR", dirs, "folders of query files")->required();
  app.add_option("--format", format, "output")->check(CLI::IsMember({"csv", "table"}))->capture_default_str();
  app.add_option("--tolerance", options.tolerance_m, "conservative: tolerance [m]")->capture_default_str();
  app.add_option("--toc-bits", options.toc_bits, "exact: bits of the TOC's cell, 10 to 52")->capture_default_str();
  app.add_option("--max-subdivisions", options.max_subdivisions, "conservative: cap per pair")->capture_default_str();
  try {
    dccd::requireDecimalNumbers(app);
    app.parse(argc, argv);
    return dccd::runQueries(dirs, options, format == "csv");
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    std::cerr << "run_queries: " << error.what() << "\n";
    return 2;
  }
}
