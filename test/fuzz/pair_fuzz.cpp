// Any bytes as a pair: every rung against the oracle and on every SIMD target, and exact against itself in another
// order of the vertices.
//
// The first byte chooses how the rest is read: a seed of the generators of hard pairs; coordinates of few bits, one or
// two bytes each, between which coincidences are likely; or doubles as they are. Missing bytes are zeros.
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "fuzz/fuzz_target.h"
#include "oracle/promises.h"
#include "support/generators.h"
#include "support/query_symmetries.h"
#include "support/step_support.h"

namespace {

using namespace dccd;
using test::RandomSource;

/// Takes bytes from the front.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  std::uint8_t byte() {
    if (size_ == 0) return 0;
    --size_;
    return *data_++;
  }
  template <typename T>
  T raw() {
    std::uint8_t bytes[sizeof(T)];
    for (std::uint8_t& b : bytes) b = byte();
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

double coordinate(Bytes& bytes, int mode) {
  switch (mode) {
    case 0:  // -8 to 7
      return (bytes.byte() & 15) - 8;
    case 1:  // seven bits and a scale
    {
      const int digits = static_cast<std::int8_t>(bytes.byte());
      return std::ldexp(digits, bytes.byte() % 64 - 32);
    }
    case 2: {  // float
      const float value = bytes.raw<float>();
      return std::isfinite(value) ? value : 0;
    }
    default: {
      const double value = bytes.raw<double>();
      return std::isfinite(value) ? value : 0;
    }
  }
}

Query decode(const std::uint8_t* data, std::size_t size) {
  Bytes bytes(data, size);
  const int choice = bytes.byte();
  const PairKind kind = (choice & 1) != 0 ? PairKind::EDGE_EDGE : PairKind::VERTEX_FACE;
  const int mode = (choice >> 1) % 5;
  if (mode == 4) {
    const auto hardness = static_cast<test::Hardness>(bytes.byte() % static_cast<int>(test::Hardness::COUNT));
    RandomSource random(bytes.raw<std::uint64_t>());
    return test::hardQuery(random, kind, hardness);
  }
  Query query;
  query.kind = kind;
  const int resting = bytes.byte();  // a bit for each point that does not move
  for (int i = 0; i < 24; ++i) {
    const int point = i / 3 % 4;
    const bool rests = i >= 12 && ((resting >> point) & 1) != 0;
    double* values = &query.motion.x[0][0][0];
    values[i] = rests ? values[i - 12] : coordinate(bytes, mode);
  }
  return query;
}

struct FuzzedRung {
  AccuracyOptions options;
  std::unique_ptr<Rung> test;
};

const std::vector<FuzzedRung>& rungs() {
  static const std::vector<FuzzedRung> all = [] {
    std::vector<FuzzedRung> result;
    const auto add = [&result](const AccuracyOptions& options) { result.push_back({options, makeRung(options)}); };
    AccuracyOptions options;
    for (int bits : {10, 32, 52}) {
      options.toc_bits = bits;
      add(options);
    }
    options.rung = Accuracy::CONSERVATIVE;
    add(options);
    return result;
  }();
  return all;
}

[[noreturn]] void report(const Query& query, const FuzzedRung& rung, const std::string& what) {
  std::ostringstream text;
  text << toString(rung.options.rung) << " " << rung.options.toc_bits << " bits: " << what << "\n"
       << queryFolder(query.kind) << ":\n";
  writeQueries(text, {query});
  throw std::logic_error(text.str());
}

void pair(const std::uint8_t* data, std::size_t size) {
  const Query query = decode(data, size);
  std::optional<test::Root> toc = test::firstContact(query.kind, query.motion);
  const auto orders = test::vertexPermutations(query.kind);
  const Query other = test::permuted(query, orders[size % orders.size()]);
  for (const FuzzedRung& rung : rungs()) {
    const ElementaryResult result = test::testQuery(*rung.test, query);
    const std::string broken = test::brokenPromise(rung.options, query, toc, result);
    if (!broken.empty()) report(query, rung, broken);
    test::forEachSimdTarget([&](const std::string& target) {
      if (!test::sameAnswer(test::testQuery(*rung.test, query), result))
        report(query, rung, "another answer on " + target);
    });
    if (rung.options.rung != Accuracy::EXACT) continue;
    if (!test::sameAnswer(test::testQuery(*rung.test, other), result)) {
      report(query, rung, "another order of the vertices, another answer");
    }
  }
}

}  // namespace

DEFORMABLE_CCD_FUZZ_TARGET(pair)
