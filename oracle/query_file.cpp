#include "oracle/query_file.h"

#include <gmp.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <istream>
#include <ostream>
#include <stdexcept>

#include "base/regular_file.h"

namespace dccd {
namespace {

namespace fs = std::filesystem;

constexpr int LINES_PER_QUERY = 8;
constexpr int COLUMNS = 7;
constexpr std::uint64_t MAX_FILE_BYTES = std::uint64_t{4} << 30;
// Any double is a fraction of two integers of at most 325 digits. Fractions that are not reduced may be longer; the
// bound keeps a hostile file from costing more than its own size.
constexpr std::size_t MAX_DIGITS = 4096;

/// A rational of GMP with an owner.
class Rational {
 public:
  Rational() { mpq_init(value_); }
  ~Rational() { mpq_clear(value_); }
  Rational(const Rational&) = delete;
  Rational& operator=(const Rational&) = delete;
  mpq_ptr get() { return value_; }

 private:
  mpq_t value_;
};

/// Where a number stands, for the messages.
struct Place {
  const std::string& name;
  std::size_t line;
  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(name + ":" + std::to_string(line) + ": " + what);
  }
};

/// A value as a message shows it: quoted, and cut where it is too long to read.
std::string shown(const std::string& text) {
  constexpr std::size_t SHOWN = 60;
  return "'" + (text.size() > SHOWN ? text.substr(0, SHOWN) + "..." : text) + "'";
}

bool isInteger(const std::string& text) {
  const std::size_t begin = !text.empty() && text[0] == '-' ? 1 : 0;
  return text.size() > begin && std::all_of(text.begin() + static_cast<std::ptrdiff_t>(begin), text.end(),
                                            [](char c) { return c >= '0' && c <= '9'; });
}

std::string trimmed(const std::string& text) {
  const char* blanks = " \t\r";
  const std::size_t begin = text.find_first_not_of(blanks);
  if (begin == std::string::npos) return {};
  return text.substr(begin, text.find_last_not_of(blanks) - begin + 1);
}

/// Splits at commas; refuses any other number of columns than seven before looking at them.
void splitLine(const std::string& line, const Place& place, std::string (&columns)[COLUMNS]) {
  const auto commas = std::count(line.begin(), line.end(), ',');
  if (commas != COLUMNS - 1) {
    place.fail("expected " + std::to_string(COLUMNS) + " columns, found " + std::to_string(commas + 1) + " in " +
               shown(line));
  }
  std::size_t begin = 0;
  for (std::string& column : columns) {
    const std::size_t end = std::min(line.find(',', begin), line.size());
    column = trimmed(line.substr(begin, end - begin));
    begin = end + 1;
  }
}

void parseInteger(const std::string& text, const Place& place, mpz_ptr value) {
  if (!isInteger(text)) place.fail("not an integer: " + shown(text));
  if (text.size() > MAX_DIGITS) place.fail("more than " + std::to_string(MAX_DIGITS) + " digits: " + shown(text));
  mpz_set_str(value, text.c_str(), 10);
}

/// The double that equals numerator/denominator; an error where there is none.
double parseFraction(const std::string& numerator, const std::string& denominator, const Place& place) {
  Rational fraction;
  parseInteger(numerator, place, mpq_numref(fraction.get()));
  parseInteger(denominator, place, mpq_denref(fraction.get()));
  if (mpz_sgn(mpq_denref(fraction.get())) == 0) place.fail("denominator is zero: " + shown(denominator));
  mpq_canonicalize(fraction.get());
  const double value = mpq_get_d(fraction.get());
  Rational back;
  // mpq_get_d() gives infinity, or rounds towards zero; only what comes back unchanged was exact.
  if (std::isfinite(value)) mpq_set_d(back.get(), value);
  if (!std::isfinite(value) || mpq_equal(back.get(), fraction.get()) == 0) {
    place.fail("no double equals " + shown(numerator + "/" + denominator));
  }
  return value;
}

bool parseTruth(const std::string& text, const Place& place) {
  if (text != "0" && text != "1") place.fail("truth must be 0 or 1, not " + shown(text));
  return text == "1";
}

void writeNumber(std::ostream& out, double value, std::string& buffer) {
  if (!std::isfinite(value)) {
    throw std::invalid_argument("a query's coordinate is not finite: " + std::to_string(value));
  }
  Rational fraction;
  mpq_set_d(fraction.get(), value);
  for (mpz_srcptr part : {mpz_srcptr(mpq_numref(fraction.get())), mpz_srcptr(mpq_denref(fraction.get()))}) {
    buffer.assign(mpz_sizeinbase(part, 10) + 2, '\0');
    mpz_get_str(&buffer[0], 10, part);
    out << buffer.c_str() << ',';
  }
}

/// Whether the folder's name is that of a kind; sets it.
bool kindFromFolder(const fs::path& folder, PairKind& kind) {
  for (PairKind candidate : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    if (folder.filename() != queryFolder(candidate)) continue;
    kind = candidate;
    return true;
  }
  return false;
}

}  // namespace

const char* queryFolder(PairKind kind) { return kind == PairKind::VERTEX_FACE ? "vertex-face" : "edge-edge"; }

std::vector<Query> readQueries(std::istream& in, PairKind kind, const std::string& name) {
  std::vector<Query> queries;
  Query query;
  query.kind = kind;
  std::string line;
  std::string columns[COLUMNS];
  int row = 0;
  std::size_t line_number = 0;
  while (std::getline(in, line)) {
    const Place place{name, ++line_number};
    if (trimmed(line).empty()) continue;
    splitLine(line, place, columns);
    for (int axis = 0; axis < 3; ++axis) {
      query.motion.x[row / 4][row % 4][axis] = parseFraction(columns[2 * axis], columns[2 * axis + 1], place);
    }
    const bool contact = parseTruth(columns[COLUMNS - 1], place);
    if (row > 0 && contact != query.contact) place.fail("truth differs from that of the query's first line");
    query.contact = contact;
    if (++row < LINES_PER_QUERY) continue;
    queries.push_back(query);
    row = 0;
  }
  if (in.bad()) throw std::runtime_error(name + ": reading failed");
  if (row != 0) Place{name, line_number}.fail("the last query has " + std::to_string(row) + " lines instead of 8");
  return queries;
}

std::vector<Query> readQueryFile(const std::string& path, PairKind kind) {
  const std::string problem = regularFileProblem(path, MAX_FILE_BYTES);
  if (!problem.empty()) throw std::runtime_error(path + ": " + problem);
  std::ifstream in(path, std::ios::binary);
  if (!in) throw std::runtime_error(path + ": cannot be opened");
  return readQueries(in, kind, path);
}

void writeQueries(std::ostream& out, const std::vector<Query>& queries) {
  std::string buffer;
  for (const Query& query : queries) {
    for (int row = 0; row < LINES_PER_QUERY; ++row) {
      for (double value : query.motion.x[row / 4][row % 4]) writeNumber(out, value, buffer);
      out << (query.contact ? "1\n" : "0\n");
    }
  }
}

void writeQueryFile(const std::string& path, const std::vector<Query>& queries) {
  std::error_code ignored;  // where this fails, opening the file fails and says so
  fs::create_directories(fs::path(path).parent_path(), ignored);
  std::ofstream out(path, std::ios::binary);
  if (!out) throw std::runtime_error(path + ": cannot be created");
  writeQueries(out, queries);
  out.flush();
  if (!out) throw std::runtime_error(path + ": writing failed");
}

std::vector<QueryFileEntry> findQueryFiles(const std::string& dir) {
  std::error_code error;
  const fs::path root = fs::canonical(dir, error);
  if (error || !fs::is_directory(root)) throw std::runtime_error(dir + ": no such folder");
  std::vector<QueryFileEntry> files;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(root)) {
    QueryFileEntry file;
    const fs::path folder = entry.path().parent_path();
    if (entry.path().extension() != ".csv" || !entry.is_regular_file() || !kindFromFolder(folder, file.kind)) continue;
    const fs::path family = folder.parent_path();
    const fs::path relative = family.lexically_relative(root);
    // The search may begin at the family or at its kind folder: then the family's own name says more than "." or "..".
    const bool inside = !relative.empty() && *relative.begin() != "." && *relative.begin() != "..";
    file.family = (inside ? relative : family.filename()).generic_string();
    file.path = entry.path().string();
    files.push_back(std::move(file));
  }
  std::sort(files.begin(), files.end(),
            [](const QueryFileEntry& a, const QueryFileEntry& b) { return a.path < b.path; });
  return files;
}

}  // namespace dccd
