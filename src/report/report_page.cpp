// The page of a report: page.html with the style, the data and the script in their places.
#include <string>

#include "page_parts.h"
#include "report/report.h"

namespace dccd {
namespace {

/// Puts `text` in the place of the mark, which the page has once.
void fill(std::string& page, const std::string& mark, const std::string& text) {
  page.replace(page.find(mark), mark.size(), text);
}

}  // namespace

std::string reportPage(const std::string& data) {
  std::string page = PAGE_HTML;
  fill(page, "@script@", PAGE_JS);  // from the end, so that no text is taken for a mark
  fill(page, "@data@", data);
  fill(page, "@style@", PAGE_CSS);
  return page;
}

}  // namespace dccd
