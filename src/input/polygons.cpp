#include "input/polygons.h"

#include <algorithm>

namespace dccd {

PolygonFaces facesOf(const Polygons& polygons, const Positions&) {
  PolygonFaces out;
  std::vector<Index> sorted;
  for (std::size_t p = 0; p < polygons.size(); ++p) {
    const auto first = polygons.corners.begin() + static_cast<std::ptrdiff_t>(polygons.begin(p));
    const auto last = polygons.corners.begin() + static_cast<std::ptrdiff_t>(polygons.ends[p]);
    sorted.assign(first, last);
    std::sort(sorted.begin(), sorted.end());
    const bool repeats = std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end();
    if (last - first < 3 || repeats) {
      out.unchecked.push_back(p);
    } else {
      for (auto corner = first + 2; corner != last; ++corner) out.faces.push_back({*first, *(corner - 1), *corner});
    }
    out.ends.push_back(out.faces.size());
  }
  return out;
}

}  // namespace dccd
