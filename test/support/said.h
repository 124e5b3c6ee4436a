// What the code says of what it refuses.
#pragma once

#include <string>

namespace dccd {
namespace test {

/// The text of the Error that `call` throws; `otherwise` where it throws none.
template <class Error, class Call>
std::string said(const Call& call, const std::string& otherwise = "") {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return otherwise;
}

inline bool mentions(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace test
}  // namespace dccd
