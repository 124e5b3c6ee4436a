// Numbers in text: a word is one whole decimal number, or it is none, whatever the locale.
#pragma once

#include <locale.h>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>

namespace dccd {

namespace detail {

inline std::string_view withoutSign(std::string_view word) {
  if (!word.empty() && (word[0] == '+' || word[0] == '-')) word.remove_prefix(1);
  return word;
}

inline bool isDigit(char c) { return c >= '0' && c <= '9'; }

/// Takes the digits at the word's begin away; says how many they were.
inline std::size_t takeDigits(std::string_view& word) {
  std::size_t digits = 0;
  while (digits < word.size() && isDigit(word[digits])) ++digits;
  word.remove_prefix(digits);
  return digits;
}

/// Digits, at most one point among or beside them, and perhaps an exponent after `e` or `E`.
inline bool isDecimal(std::string_view word) {
  word = withoutSign(word);
  std::size_t digits = takeDigits(word);
  if (!word.empty() && word[0] == '.') {
    word.remove_prefix(1);
    digits += takeDigits(word);
  }
  if (digits == 0) return false;
  if (word.empty()) return true;
  if (word[0] != 'e' && word[0] != 'E') return false;
  word = withoutSign(word.substr(1));
  return takeDigits(word) > 0 && word.empty();
}

inline bool isNanOrInfinity(std::string_view word) {
  word = withoutSign(word);
  std::string small(word.substr(0, 9));
  for (char& c : small) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  return small == "nan" || small == "inf" || small == "infinity";
}

}  // namespace detail

/// The double nearest to a decimal number such as -0.5, .5, 5. or +5e-3; also nan, inf and infinity, in capitals or
/// not. Nothing for all else: a blank, a comma, 1.0-1, 1.0D-2, hexadecimal digits, and what is too large for a double.
inline std::optional<double> decimalNumber(std::string_view word) {
  if (!detail::isDecimal(word) && !detail::isNanOrInfinity(word)) return std::nullopt;
  // std::from_chars has no floating numbers in libstdc++ 10.
  static const locale_t PLAIN = ::newlocale(LC_ALL_MASK, "C", nullptr);
  const double value = ::strtod_l(std::string(word).c_str(), nullptr, PLAIN);
  if (std::isinf(value) && detail::isDecimal(word)) return std::nullopt;
  return value;
}

/// An integer of digits alone, with or without a sign; nothing for all else, also what 64 bits do not hold.
inline std::optional<std::int64_t> decimalInteger(std::string_view word) {
  if (!word.empty() && word[0] == '+') {
    word.remove_prefix(1);
    if (word.empty() || !detail::isDigit(word[0])) return std::nullopt;
  }
  std::int64_t value = 0;
  const auto [end, problem] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (problem != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

/// A zero before other digits, which makes 8 of 010 where C's or YAML's rules hold.
inline bool looksOctal(std::string_view word) {
  word = detail::withoutSign(word);
  return word.size() > 1 && word[0] == '0' && detail::isDigit(word[1]);
}

}  // namespace dccd
