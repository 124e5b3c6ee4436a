// What messages say, where it goes into a reason, a hint or a line of log: a message can hold 50 MB of a name.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace dccd {

constexpr std::size_t MAX_NAME = 200, MAX_TEXT = 1000;

/// At most `limit` bytes, with how many were left out; control characters as spaces, so that one line stays one.
inline std::string shortText(std::string_view text, std::size_t limit = MAX_TEXT) {
  std::string kept(text.substr(0, limit));
  for (char& c : kept) {
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7f') c = ' ';
  }
  if (text.size() > limit) kept += "… (" + std::to_string(text.size() - limit) + " more)";
  return kept;
}

/// "a, b, c".
inline std::string listOf(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list;
}

/// Empty when tf2 takes it as a frame's name; else what is wrong with it, in a few words. tf2 itself writes a line to
/// the console for each name that it does not take.
inline std::string frameNameProblem(const std::string& name) {
  if (name.empty()) return "it is empty";
  if (name[0] == '/') return "it begins with a slash";
  if (name.size() > MAX_NAME) return "it has " + std::to_string(name.size()) + " characters";
  return {};
}

}  // namespace dccd
