#include "input/text_lines.h"

#include <algorithm>

#include "base/decimal.h"
#include "input/mesh_file.h"

namespace dccd {

namespace {

constexpr std::string_view BLANKS = " \t\f\v", LINE_ENDS = "\n\r", UTF8_MARK = "\xef\xbb\xbf";

/// In a line: what holds more is no mesh, and would take many times its own size as words.
constexpr std::size_t MAX_WORDS = 1000000;

bool beginsWith(std::string_view text, std::string_view with) { return text.substr(0, with.size()) == with; }

}  // namespace

std::string inSmallLetters(std::string_view word) {
  std::string small(word);
  for (char& c : small) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  return small;
}

std::string inQuotes(std::string_view word) {
  constexpr std::size_t SHOWN = 40;
  std::string text(word.substr(0, SHOWN));
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return "'" + text + (word.size() > SHOWN ? "...'" : "'");
}

TextLines::TextLines(std::string_view text, const std::string& path, std::size_t line)
    : rest_(text), path_(path), line_(line), next_line_(line) {
  if (beginsWith(rest_, "\xff\xfe") || beginsWith(rest_, "\xfe\xff")) {
    throw MeshFileError(path + ": is text in UTF-16; save it as ASCII or UTF-8");
  }
  if (beginsWith(rest_, UTF8_MARK)) rest_.remove_prefix(UTF8_MARK.size());
}

bool TextLines::next() {
  words_.clear();
  return append();
}

bool TextLines::append() {
  if (rest_.empty()) return false;
  line_ = next_line_++;
  const std::size_t end = std::min(rest_.find_first_of(LINE_ENDS), rest_.size());
  line_text_ = rest_.substr(0, end);
  rest_.remove_prefix(end);
  if (!rest_.empty()) rest_.remove_prefix(beginsWith(rest_, "\r\n") ? 2 : 1);
  split();
  return true;
}

bool TextLines::nextWithWords() {
  while (next()) {
    if (!words_.empty()) return true;
  }
  return false;
}

void TextLines::split() {
  std::string_view text = line_text_;
  while (true) {
    text.remove_prefix(std::min(text.find_first_not_of(BLANKS), text.size()));
    if (text.empty()) return;
    if (words_.size() == MAX_WORDS) fail("has more than " + std::to_string(MAX_WORDS) + " words");
    const std::size_t end = std::min(text.find_first_of(BLANKS), text.size());
    words_.push_back({text.substr(0, end), line_});
    text.remove_prefix(end);
  }
}

void TextLines::fail(const std::string& what) const {
  throw MeshFileError(path_ + ":" + std::to_string(line_) + ": " + what);
}

void TextLines::fail(const TextWord& word, const std::string& what) const {
  throw MeshFileError(path_ + ":" + std::to_string(word.line) + ": " + inQuotes(word.text) + " " + what);
}

double TextLines::number(const TextWord& word) const {
  const auto value = decimalNumber(word.text);
  if (!value) fail(word, "is no decimal number, such as -0.5 or 1e-3");
  return *value;
}

std::int64_t TextLines::integer(const TextWord& word) const {
  const auto value = decimalInteger(word.text);
  if (!value) fail(word, "is no integer");
  return *value;
}

}  // namespace dccd
