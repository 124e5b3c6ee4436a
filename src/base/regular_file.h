// Files that are safe to be read whole.
#pragma once

#include <sys/stat.h>

#include <cerrno>
#include <cstdint>
#include <limits>
#include <string>
#include <system_error>

namespace dccd {

/// Empty when the path is a regular file of at most `max_bytes`; else what it is, to stand behind its name. A device or
/// a pipe would never come to an end, and one that is only opened may already wait for ever.
inline std::string regularFileProblem(const std::string& path,
                                      std::uint64_t max_bytes = std::numeric_limits<std::uint64_t>::max()) {
  struct stat file {};
  if (::stat(path.c_str(), &file) != 0) {
    return "cannot be opened: " + std::generic_category().message(errno);
  }
  if (!S_ISREG(file.st_mode)) return "is no regular file";
  const auto bytes = static_cast<std::uint64_t>(file.st_size);
  if (bytes <= max_bytes) return {};
  return "has " + std::to_string(bytes) + " bytes, at most " + std::to_string(max_bytes) + " are read";
}

}  // namespace dccd
