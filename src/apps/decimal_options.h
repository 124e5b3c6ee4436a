// What the command lines of the tools have in common: numbers, what is said of an unknown option, and that no tool
// writes over what it reads.
#pragma once

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "base/decimal.h"
#include "config/nearest_name.h"

namespace dccd {

/// An unknown option is answered with the nearest one that there is.
inline std::string nearestOptions(const CLI::App* app, const CLI::Error& error) {
  std::string text = CLI::FailureMessage::simple(app, error);
  std::vector<std::string> known;
  for (const CLI::Option* option : app->get_options()) {
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  }
  for (const std::string& word : app->remaining()) {
    if (word.rfind("--", 0) == 0) text += word + " is no option; nearest is " + nearestName(word, known) + '\n';
  }
  return text;
}

/// Once all options are there: CLI11 takes `0x10`, `010` (8) and `nan` for numbers, too.
inline void requireDecimalNumbers(CLI::App& app) {
  app.failure_message(nearestOptions);
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

/// Throws std::runtime_error where an output is the input, by whatever name: the input would be gone.
inline void refuseToOverwrite(const std::string& input, const std::vector<std::string>& outputs) {
  for (const std::string& output : outputs) {
    std::error_code none;  // what is not there yet is no other file
    if (!std::filesystem::equivalent(input, output, none)) continue;
    throw std::runtime_error(output + ": is the input " + input + ", which would be lost; write to another file");
  }
}

}  // namespace dccd
