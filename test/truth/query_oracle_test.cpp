// The oracle against the truth columns: before anything else is judged by it.
#include <gtest/gtest.h>

#include <iostream>

#include "oracle/oracle.h"
#include "oracle/query_file.h"
#include "support/data.h"

namespace dccd {
namespace test {
namespace {

TEST(QueryOracle, AgreesWithEveryTruthColumn) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  std::size_t queries = 0, contacts = 0;
  for (const QueryFileEntry& file : findQueryFiles(dataDir() + "/ccd_queries")) {
    std::size_t index = 0;
    for (const Query& query : readQueryFile(file.path, file.kind)) {
      std::optional<Root> toc = firstContactThorough(file.kind, query.motion);
      EXPECT_EQ(toc.has_value(), query.contact) << file.path << ", query " << index;
      ++index;
      ++queries;
      contacts += query.contact;
    }
  }
  EXPECT_EQ(queries, 4279u);
  EXPECT_EQ(contacts, 245u);
  std::cout << "oracle against truth columns: " << queries << " queries, " << contacts << " contacts\n";
}

}  // namespace
}  // namespace test
}  // namespace dccd
