// The core's headers, then the package's messages. Each finds its own names in either order.
#include "dccd/contact.h"
#include "dccd/stream.h"

#include <deformable_ccd/Contact.h>
#include <deformable_ccd/ContactArray.h>
#include <deformable_ccd/StepStats.h>

#include <gtest/gtest.h>

#include <type_traits>

namespace {

using namespace dccd;

TEST(IncludeOrder, CoreFirst) {
  Contact contact;
  deformable_ccd::Contact message;
  contact.toc_lower = message.toc_lower = 0.25;
  EXPECT_EQ(contact.toc_lower, message.toc_lower);
  EXPECT_FALSE((std::is_same_v<StepStats, deformable_ccd::StepStats>));
  EXPECT_EQ(static_cast<int>(StepStatus::OK), static_cast<int>(deformable_ccd::ContactArray::OK));
}

}  // namespace
