// The rungs that makeRung() chooses between. Options are validated there, once for all of them.
#pragma once

#include <memory>

#include "dccd/elementary.h"

namespace dccd {

std::unique_ptr<Rung> makeFastRung(const AccuracyOptions& options);
std::unique_ptr<Rung> makeConservativeRung(const AccuracyOptions& options);
std::unique_ptr<Rung> makeExactRung(const AccuracyOptions& options);

}  // namespace dccd
