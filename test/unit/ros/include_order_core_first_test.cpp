// The core's headers, then the package's messages: each finds its own names in either order.
#include "dccd/contact.h"
#include "dccd/stream.h"

#include <deformable_ccd/Contact.h>
#include <deformable_ccd/ContactArray.h>
#include <deformable_ccd/StepStats.h>

static_assert(!std::is_same_v<dccd::Contact, deformable_ccd::Contact>);
static_assert(!std::is_same_v<dccd::StepStats, deformable_ccd::StepStats>);
static_assert(static_cast<int>(dccd::StepStatus::OK) == deformable_ccd::ContactArray::OK);
