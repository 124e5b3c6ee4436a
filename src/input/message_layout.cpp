#include "input/message_layout.h"

#include <algorithm>
#include <map>
#include <sstream>
#include <utility>
#include <vector>

#include "input/short_text.h"

namespace dccd {
namespace {

// Of a definition that is hostile.
constexpr std::size_t MOST_FIELDS = 1000, DEEPEST = 10;

struct Field {
  std::string type, array, name;  // "float64", "[36]", "covariance"
};
using Types = std::map<std::string, std::vector<Field>>;

std::string packageOf(const std::string& datatype) { return datatype.substr(0, datatype.find('/')); }

/// Each type of the text, which begins with `datatype` and has the types of its fields behind it.
Types typesOf(const std::string& datatype, const std::string& definition) {
  Types types;
  std::vector<Field>* fields = &types[datatype];
  std::istringstream lines(definition);
  for (std::string line; std::getline(lines, line);) {
    line = line.substr(0, line.find('#'));
    if (line.find('=') != std::string::npos) continue;  // a constant, or what parts two types
    std::istringstream words(line);
    std::string type, name;
    if (!(words >> type >> name)) continue;
    if (type == "MSG:") {
      fields = &types[name];
      continue;
    }
    const std::size_t bracket = std::min(type.find('['), type.size());
    fields->push_back({type.substr(0, bracket), type.substr(bracket), name});
  }
  return types;
}

/// A line for each field on the wire, those of a message in their place.
void flatten(const Types& types, const std::string& datatype, const std::string& path, std::size_t depth,
             std::vector<std::string>& lines) {
  const auto found = types.find(datatype);
  if (found == types.end() || depth > DEEPEST) return lines.push_back("unknown " + datatype + " " + path);
  for (const Field& field : found->second) {
    if (lines.size() > MOST_FIELDS) return;
    const std::string name = path + (path.empty() ? "" : ".") + field.name + field.array;
    const std::string nested = field.type == "Header"                      ? "std_msgs/Header"
                               : field.type.find('/') != std::string::npos ? field.type
                                                                           : packageOf(datatype) + "/" + field.type;
    const std::string basic = field.type == "byte" ? "int8" : field.type == "char" ? "uint8" : field.type;
    if (types.count(nested) > 0) {
      flatten(types, nested, name, depth + 1, lines);
    } else {
      lines.push_back(basic + " " + name);
    }
  }
}

std::vector<std::string> linesOf(const std::string& datatype, const std::string& definition) {
  std::vector<std::string> lines;
  flatten(typesOf(datatype, definition), datatype, "", 0, lines);
  return lines;
}

}  // namespace

std::string layoutDifference(const std::string& datatype, const std::string& definition, const std::string& known) {
  const std::vector<std::string> there = linesOf(datatype, definition), here = linesOf(datatype, known);
  const auto [a, b] = std::mismatch(there.begin(), there.end(), here.begin(), here.end());
  if (a == there.end() && b == here.end()) return {};
  const auto shown = [](auto at, auto end) { return at == end ? "nothing" : "'" + shortText(*at, MAX_NAME) + "'"; };
  return "it has " + shown(a, there.end()) + " where " + shown(b, here.end()) + " is known";
}

}  // namespace dccd
