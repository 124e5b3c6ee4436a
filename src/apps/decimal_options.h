// Numbers on the command lines of the tools.
#pragma once

#include <CLI/CLI.hpp>
#include <cmath>
#include <string>

#include "dccd/decimal.h"

namespace dccd {

/// Once all options are there: CLI11 takes `0x10`, `010` (8) and `nan` for numbers, too.
inline void requireDecimalNumbers(CLI::App& app) {
  for (CLI::Option* option : app.get_options()) {
    const std::string type = option->get_type_name();
    const auto is = [&](const char* name) { return type.rfind(name, 0) == 0; };
    if (is("FLOAT")) {
      option->check([](const std::string& word) {
        const auto number = decimalNumber(word);
        return number && std::isfinite(*number) ? std::string() : "'" + word + "' is no decimal number";
      });
    } else if (is("INT") || is("UINT")) {
      option->check([](const std::string& word) {
        return decimalInteger(word) && !looksOctal(word)
                   ? std::string()
                   : "'" + word + "' is no decimal integer, written without zeros before it";
      });
    }
  }
}

}  // namespace dccd
