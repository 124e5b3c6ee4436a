#include "support/margin_witnesses.h"

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace dccd {
namespace test {

std::vector<MarginInput> marginWitnesses(const std::string& margin) {
  const std::string path = std::string(DEFORMABLE_CCD_SOURCE_DIR) + "/test/margins/witnesses.txt";
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path);
  std::vector<MarginInput> witnesses;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string name, number;
    MarginInput input;
    words >> name >> input.variant;
    while (words >> number) input.x.push_back(std::strtod(number.c_str(), nullptr));
    if (name == margin) witnesses.push_back(input);
  }
  return witnesses;
}

std::string witnessLine(const std::string& margin, const MarginInput& input) {
  std::string line = margin + " " + std::to_string(input.variant);
  char text[40];
  for (const double x : input.x) {
    std::snprintf(text, sizeof text, " %a", x);
    line += text;
  }
  return line;
}

}  // namespace test
}  // namespace dccd
