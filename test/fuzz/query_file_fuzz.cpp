// Any bytes as a query file: refused with a message that can be read, or read and written without loss.
#include <algorithm>
#include <cstring>
#include <sstream>
#include <stdexcept>
#include <string>

#include "fuzz/fuzz_target.h"
#include "oracle/query_file.h"

namespace {

using dccd::Query;

void query_file(const std::uint8_t* data, std::size_t size) {
  const auto kind = size % 2 == 0 ? dccd::PairKind::VERTEX_FACE : dccd::PairKind::EDGE_EDGE;
  std::istringstream in(std::string(data, data + size));
  std::vector<Query> queries;
  try {
    queries = dccd::readQueries(in, kind, "input");
  } catch (const std::runtime_error& error) {
    const std::string message = error.what();
    if (message.rfind("input:", 0) != 0 || message.size() > 300) throw std::logic_error("message: " + message);
    return;
  }
  std::stringstream copy;
  dccd::writeQueries(copy, queries);
  const std::vector<Query> again = dccd::readQueries(copy, kind, "copy");
  const bool equal =
      std::equal(queries.begin(), queries.end(), again.begin(), again.end(), [](const Query& a, const Query& b) {
        return a.contact == b.contact && std::memcmp(a.motion.x, b.motion.x, sizeof a.motion.x) == 0;
      });
  if (!equal) throw std::logic_error("written and read again, the queries differ");
}

}  // namespace

DEFORMABLE_CCD_FUZZ_TARGET(query_file)
