// Where the tests find the data with exact truth. It is read from there and never copied into the project.
#pragma once

#include <gtest/gtest.h>

#include <string>

namespace dccd {
namespace test {

/// The data folder: the environment variable DEFORMABLE_CCD_DATA, else ../shared/data beside the package's sources.
/// Empty when there is no such folder.
std::string dataDir();

/// Says where dataDir() looked, for the skip message.
std::string dataDirHint();

}  // namespace test
}  // namespace dccd

/// Skips the running test, with the reason printed, where the data is absent. Use it in the body of a test.
#define DEFORMABLE_CCD_REQUIRE_DATA()                                  \
  do {                                                                 \
    if (::dccd::test::dataDir().empty()) {                             \
      GTEST_SKIP() << "no test data: " << ::dccd::test::dataDirHint(); \
    }                                                                  \
  } while (false)
