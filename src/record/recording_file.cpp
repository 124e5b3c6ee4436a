// Recordings as files of a disk.
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>

#include "dccd/regular_file.h"
#include "record/step_recording.h"

namespace dccd {

namespace {

constexpr std::uint64_t MAX_FILE_BYTES = std::uint64_t{4} << 30;
constexpr int MAX_COPIES = 1000;

std::string systemText(const std::string& path) { return path + ": cannot be written: " + std::strerror(errno); }

}  // namespace

bool RecordingImage::write(int descriptor) const noexcept {
  for (const Piece& piece : pieces_) {
    const char* data = static_cast<const char*>(piece.data ? piece.data : heads_.data() + piece.offset);
    std::size_t left = piece.size;
    while (left > 0) {
      const ssize_t written = ::write(descriptor, data, left);
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) return false;
      data += written;
      left -= static_cast<std::size_t>(written);
    }
  }
  return true;
}

std::size_t RecordingImage::bytes() const {
  std::size_t sum = 0;
  for (const Piece& piece : pieces_) sum += piece.size;
  return sum;
}

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
  RecordingImage image;
  image.build(recording);
  const std::string part = path + ".part";
  const int descriptor = ::open(part.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (descriptor < 0) throw std::runtime_error(systemText(path));
  bool good = image.write(descriptor);
  int why = errno;
  // A full disk may show up only here.
  if (::close(descriptor) != 0 && good) {
    good = false;
    why = errno;
  }
  if (good && std::rename(part.c_str(), path.c_str()) != 0) {
    good = false;
    why = errno;
  }
  if (good) return;
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
