// A mesh as the text of an STL file.
#pragma once

#include <sstream>
#include <string>

#include "support/step_support.h"

namespace dccd {
namespace test {

inline std::string stlText(const StepBody& body) {
  std::ostringstream stl;
  stl << "solid body\n";
  for (const Face& face : body.topology.faces()) {
    stl << "facet normal 0 0 0\nouter loop\n";
    for (const Index v : face) stl << "vertex " << body.t0[v].transpose() << '\n';
    stl << "endloop\nendfacet\n";
  }
  stl << "endsolid body\n";
  return stl.str();
}

}  // namespace test
}  // namespace dccd
