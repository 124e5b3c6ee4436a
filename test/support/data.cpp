#include "support/data.h"

#include <cstdlib>
#include <filesystem>

namespace dccd {
namespace test {
namespace {

std::string candidate() {
  const char* from_environment = std::getenv("DEFORMABLE_CCD_DATA");
  if (from_environment != nullptr && *from_environment != '\0') return from_environment;
#ifdef DEFORMABLE_CCD_SOURCE_DIR
  return std::string(DEFORMABLE_CCD_SOURCE_DIR) + "/../shared/data";
#else
  return {};
#endif
}

}  // namespace

std::string dataDir() {
  const std::string path = candidate();
  std::error_code ignored;
  return !path.empty() && std::filesystem::is_directory(path, ignored) ? path : std::string();
}

std::string dataDirHint() {
  const std::string path = candidate();
  return "set DEFORMABLE_CCD_DATA (looked for " + (path.empty() ? std::string("nothing") : "'" + path + "'") + ")";
}

}  // namespace test
}  // namespace dccd
