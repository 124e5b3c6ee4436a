// The page of a report: page.html with the style, the data and the scripts in their places.
#include <string>

#include "page_parts.h"
#include "report/report.h"

namespace dccd {
namespace {

/// Puts `text` in the place of the mark, which the page has once.
void fill(std::string& page, const std::string& mark, const std::string& text) {
  page.replace(page.find(mark), mark.size(), text);
}

// "</" would end the script element that carries the data, and "<!--" could hide its end.
void makeSafe(std::string& json) {
  for (std::size_t at = 0; (at = json.find('<', at)) != std::string::npos; at += 6) json.replace(at, 1, "\\u003c");
}

}  // namespace

std::string reportPage(std::string data, std::string player) {
  makeSafe(data);
  makeSafe(player);
  std::string page = PAGE_HTML;
  fill(page, "@player_script@", PLAYER_JS);  // from the end, so that no text is taken for a mark
  fill(page, "@three@", THREE_JS);
  fill(page, "@lanes_script@", LANES_JS);
  fill(page, "@script@", PAGE_JS);
  fill(page, "@data@", data);
  fill(page, "@player@", player);
  fill(page, "@style@", PAGE_CSS);
  return page;
}

}  // namespace dccd
