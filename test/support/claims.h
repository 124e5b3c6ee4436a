// Claims of outcomes that are made by hand.
#pragma once

#include <string>

#include "dccd/outcome.h"

namespace dccd {
namespace test {

/// All questions are answered, and the answer to one of them is no.
inline Claim claimBut(Question question, const std::string& why_not) {
  Claim claim = Claim::thatWasSaid({});
  claim.answer(question, why_not);
  return claim;
}

}  // namespace test
}  // namespace dccd
