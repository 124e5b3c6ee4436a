// The rungs that makeElementaryTest() chooses between. Options are validated there, once for all of them.
#pragma once

#include <memory>

#include "deformable_ccd/elementary.h"

namespace deformable_ccd {

std::unique_ptr<ElementaryTest> makeFastTest(const AccuracyOptions& options);
std::unique_ptr<ElementaryTest> makeConservativeTest(const AccuracyOptions& options);
std::unique_ptr<ElementaryTest> makeExactTest(const AccuracyOptions& options);

}  // namespace deformable_ccd
