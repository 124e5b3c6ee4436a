// What people are told of an outcome, in sentences: made once, where it is concluded. Messages and the log carry them.
#pragma once

#include <string>
#include <vector>

#include "dccd/assurance.h"
#include "dccd/contact.h"

namespace dccd {

struct Statement {
  Assurance assurance;
  std::string touches;  ///< who touches whom, since when and where; empty where nothing does, and without patches
  std::string hint;     ///< what to do about what is not proved, see adviceFor(); may be empty
  std::string broken;   ///< why the promise before this answer was void, see PromiseWatch::broken(); empty: it was not
  std::vector<std::string> doubts;  ///< why what was looked at may be something else, whatever is proved of it
  bool is_doubts_fault = false;     ///< they explain the status, where they are right: their cure is the only one
};

/// `map_source`: the octomap's resolved topic or its file. `doubts`: MonitorPipeline::doubts().
Statement statementOf(const Outcome& outcome, const std::string& map_source, const std::string& broken,
                      std::vector<std::string> doubts = {});

/// The line of ~first_contact; `first` is null where no contact is known.
std::string firstContactInWords(const Outcome& outcome, double toc, const Contact* first,
                                const std::vector<Body>& bodies);

}  // namespace dccd
