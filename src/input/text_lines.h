// The lines of a text file and their words, for the readers of mesh files.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace dccd {

struct TextWord {
  std::string_view text;
  std::size_t line;  ///< as the file counts it, from 1
};

/// Blanks are space, tab, form feed and vertical tab. A line ends with LF, CR LF or CR alone. The mark of UTF-8 at the
/// text's begin is no part of it.
class TextLines {
 public:
  /// Both must outlive this. `line`: the number of the text's first line. Throws MeshFileError for UTF-16.
  TextLines(std::string_view text, const std::string& path, std::size_t line = 1);

  /// Goes to the next line, which may be empty; false at the end.
  bool next();
  /// Adds the words of the next line to those of this one; false at the end.
  bool append();
  /// Goes to the next line that has words; false at the end.
  bool nextWithWords();

  const std::vector<TextWord>& words() const { return words_; }
  /// The line without its end; after append() the last one.
  std::string_view text() const { return line_text_; }
  std::size_t line() const { return line_; }
  /// Where the next line begins.
  std::string_view rest() const { return rest_; }

  /// These name the file, the line and, where it is about one, the word.
  [[noreturn]] void fail(const std::string& what) const;
  [[noreturn]] void fail(const TextWord& word, const std::string& what) const;
  double number(const TextWord& word) const;
  std::int64_t integer(const TextWord& word) const;

 private:
  void split();

  std::string_view rest_, line_text_;
  const std::string& path_;
  std::size_t line_, next_line_;
  std::vector<TextWord> words_;
};

/// In small letters, of ASCII alone.
std::string inSmallLetters(std::string_view word);
/// In quotes, cut where it is long; what cannot be printed as '?'.
std::string inQuotes(std::string_view word);

}  // namespace dccd
