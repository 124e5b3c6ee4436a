// Prints what a time depends on: the machine, and how long a fixed kernel takes on it now.
#include <iostream>

#include "support/timing.h"

int main() {
  std::cout << dccd::benchmarks::machine().dump() << "\n";
  return std::cout ? 0 : 1;
}
