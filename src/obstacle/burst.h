// Buffers are kept from step to step, but not what a burst made of them.
#pragma once

#include <cstddef>
#include <vector>

namespace dccd {

constexpr std::size_t KEPT_BYTES = std::size_t{1} << 20;  ///< a buffer may always keep this
constexpr std::size_t KEPT_FOR_USE = 4;                   ///< and this many times what was in use

/// Gives back memory of which the last use took less than a quarter. used: elements then.
template <class T>
void releaseBurst(std::vector<T>& buffer, std::size_t used) {
  if (buffer.capacity() * sizeof(T) > KEPT_BYTES && buffer.capacity() > KEPT_FOR_USE * used) buffer.shrink_to_fit();
}
/// Its present contents are the last use.
template <class T>
void releaseBurst(std::vector<T>& buffer) {
  releaseBurst(buffer, buffer.size());
}

}  // namespace dccd
