// Recordings as files of a disk.
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>

#include "base/regular_file.h"
#include "record/step_recording.h"

namespace dccd {

namespace {

constexpr std::uint64_t MAX_FILE_BYTES = std::uint64_t{4} << 30;
constexpr int MAX_COPIES = 1000;

std::string systemText(const std::string& path) { return path + ": cannot be written: " + std::strerror(errno); }

}  // namespace

std::string writeNewRecording(const std::string& stem, const StepRecording& recording) {
  for (int copy = 1; copy <= MAX_COPIES; ++copy) {
    const std::string path = stem + (copy == 1 ? "" : "_" + std::to_string(copy)) + ".step";
    // Whoever makes the file has its name; it is written in its place when it is whole.
    const int reserved = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    if (reserved < 0 && errno == EEXIST) continue;
    if (reserved < 0) throw std::runtime_error(systemText(path));
    ::close(reserved);
    try {
      writeRecording(path, recording);
    } catch (const std::runtime_error&) {
      ::unlink(path.c_str());
      throw;
    }
    return path;
  }
  throw std::runtime_error(stem + ".step: " + std::to_string(MAX_COPIES) + " files of this name are there already");
}

void writeRecording(const std::string& path, const StepRecording& recording) {
  const std::string part = path + ".part";
  std::FILE* file = std::fopen(part.c_str(), "wbe");
  if (!file) throw std::runtime_error(systemText(path));
  int why = 0;
  serialise(recording, [&](const void* data, std::size_t size) {
    if (why == 0 && size > 0 && std::fwrite(data, size, 1, file) != 1) why = errno;
  });
  // A full disk may show up only here.
  if (std::fclose(file) != 0 && why == 0) why = errno;
  if (why == 0 && std::rename(part.c_str(), path.c_str()) != 0) why = errno;
  if (why == 0) return;
  ::unlink(part.c_str());
  errno = why;
  throw std::runtime_error(systemText(path));
}

StepRecording readRecordingFile(const std::string& path) {
  const std::string problem = regularFileProblem(path, MAX_FILE_BYTES);
  if (!problem.empty()) throw RecordingError(path + ": " + problem);
  std::ifstream in(path, std::ios::binary);
  if (!in) throw RecordingError(path + ": cannot be read");
  const std::vector<char> bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  return readRecording(bytes.data(), bytes.size(), path);
}

}  // namespace dccd
