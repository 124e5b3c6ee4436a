// Pixels that mix what is in front at an edge with what is behind: nothing is where they say.
#pragma once

#include <cstddef>
#include <vector>

namespace dccd {

/// Makes them NaN. values: row by row, `dimensions` a pixel: its depth, or its point. A pixel flies if two opposite
/// neighbours are nearer and farther than it, and each of the eight that has a depth is by more than apart_m. Without
/// all of both opposite ones, or beside one that is as near, it stays.
void leaveOutFlying(std::vector<float>& values, std::size_t width, std::size_t dimensions, double apart_m);

}  // namespace dccd
