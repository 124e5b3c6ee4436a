// What ~attach is asked for, read and checked as strictly as a parameter.
#pragma once

#include <deformable_ccd/AttachObject.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "config/monitor_config.h"

namespace dccd {

/// An object that a link or a rigid body holds.
struct AttachedObject {
  std::string name;
  std::string link;                          ///< as it was asked for
  std::string frame;                         ///< of tf, which carries it
  std::shared_ptr<const MeshResource> mesh;  ///< [m], in that frame
  double padding_m = 0;                      ///< minimum separation
  std::vector<std::uint16_t> expected;       ///< bodies whose contacts with it are expected
};

/// More bytes of a file, and more triangles, are refused: whoever waits for an answer does not wait for those.
constexpr std::uintmax_t MOST_ATTACHED_BYTES = std::uintmax_t{32} << 20;
constexpr std::size_t MOST_ATTACHED_TRIANGLES = 200000;

/// Reads what of the configuration never changes: any thread may call it. Throws ParameterError, one sentence with the
/// object, the field, its value and what to write.
AttachedObject readAttach(const deformable_ccd::AttachObject::Request& request, const MonitorConfig& config);

}  // namespace dccd
