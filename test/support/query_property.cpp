#include "support/query_property.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <optional>
#include <sstream>

#include "oracle/oracle.h"
#include "support/generators.h"
#include "support/simpler_queries.h"

namespace dccd {

/// RapidCheck shows counterexamples with this.
static void showValue(const Query& query, std::ostream& out) {
  out << toString(query.kind) << '\n';
  writeQueries(out, {query});
}

namespace test {
namespace {

rc::Gen<Query> arbitraryHardQuery() {
  const auto drawn = rc::gen::map(rc::gen::noShrink(rc::gen::resize(100, rc::gen::arbitrary<std::uint64_t>())),
                                  [](std::uint64_t draw) {
                                    RandomSource random(draw);
                                    return hardQuery(random);
                                  });
  return rc::gen::shrink(drawn, [](const Query& query) { return rc::seq::fromContainer(simplerQueries(query)); });
}

}  // namespace

bool longRun() {
  const char* text = std::getenv("DEFORMABLE_CCD_LONG");
  return text != nullptr && *text != '\0' && std::string(text) != "0";
}

std::uint64_t propertySeed() {
  const char* text = std::getenv("DEFORMABLE_CCD_SEED");
  return text != nullptr ? std::strtoull(text, nullptr, 10) : 20170601;
}

std::string writeReplayFile(const std::string& name, Query query) {
  query.contact = firstContact(query.kind, query.motion).has_value();
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "deformable_ccd_failures" / name;
  std::filesystem::remove_all(folder);
  writeQueryFile((folder / queryFolder(query.kind) / "0.csv").string(), {query});
  return folder.string();
}

void checkHardQueries(const std::string& name, int queries, const QueryProperty& property) {
  // RapidCheck's shrinking ends with the last pair that failed.
  std::optional<Query> last;
  std::string what;
  const auto holds = [&] {
    const Query query = *arbitraryHardQuery();
    std::string wrong;
    try {
      wrong = property(query);
    } catch (const std::exception& error) {
      wrong = std::string("throws ") + error.what();
    }
    if (wrong.empty()) return;
    last = query;
    what = wrong;
    RC_FAIL(wrong);
  };
  rc::detail::TestParams params;
  params.seed = propertySeed();
  params.maxSuccess = queries;
  const rc::detail::TestResult result = rc::detail::checkTestable(holds, rc::detail::TestMetadata(), params);
  if (result.is<rc::detail::SuccessResult>()) {
    std::cout << name << ": " << queries << " hard pairs, seed " << params.seed << "\n";
    return;
  }
  std::ostringstream message;
  if (last) {
    message << name << ": " << what << "\nreplay: run_queries " << writeReplayFile(name, *last) << "\n";
    showValue(*last, message);
  }
  rc::detail::printResultMessage(result, message);
  ADD_FAILURE() << message.str();
}

}  // namespace test
}  // namespace dccd
