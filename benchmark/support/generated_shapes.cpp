#include "support/generated_shapes.h"

#include <cmath>
#include <map>

namespace dccd {
namespace test {

TriangleShape sheet(std::size_t cells, double side_m) {
  TriangleShape s;
  const std::size_t n = cells + 1;
  for (std::size_t r = 0; r < n; ++r) {
    for (std::size_t c = 0; c < n; ++c) {
      s.vertices.emplace_back((static_cast<double>(c) / static_cast<double>(cells) - 0.5) * side_m,
                              (static_cast<double>(r) / static_cast<double>(cells) - 0.5) * side_m, 0.0);
    }
  }
  for (std::size_t r = 0; r < cells; ++r) {
    for (std::size_t c = 0; c < cells; ++c) {
      const Index i = static_cast<Index>(r * n + c), right = i + 1, up = i + static_cast<Index>(n);
      // The diagonals alternate, so that the sheet has no preferred direction to fold along.
      if ((r + c) % 2 == 0) {
        s.faces.push_back({i, right, up + 1});
        s.faces.push_back({i, up + 1, up});
      } else {
        s.faces.push_back({i, right, up});
        s.faces.push_back({right, up + 1, up});
      }
    }
  }
  return s;
}

TriangleShape cubeSphere(std::size_t cells) {
  TriangleShape s;
  std::map<std::array<std::size_t, 3>, Index> number;  // by position on the integer cube
  const auto vertex = [&](const std::array<std::size_t, 3>& p) {
    const auto [it, is_new] = number.try_emplace(p, static_cast<Index>(s.vertices.size()));
    if (is_new) {
      Vec3 x;
      for (int k = 0; k < 3; ++k) {
        // Equal angles instead of equal lengths: cells differ in size by 1.4 instead of 3.
        const double a = 2.0 * static_cast<double>(p[static_cast<std::size_t>(k)]) / static_cast<double>(cells) - 1.0;
        x[k] = std::tan(a * std::atan(1.0));
      }
      s.vertices.push_back(x.normalized());
    }
    return it->second;
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t side : {std::size_t{0}, cells}) {
      for (std::size_t i = 0; i < cells; ++i) {
        for (std::size_t j = 0; j < cells; ++j) {
          const auto at = [&](std::size_t di, std::size_t dj) {
            std::array<std::size_t, 3> p{};
            p[axis] = side;
            p[(axis + 1) % 3] = i + di;
            p[(axis + 2) % 3] = j + dj;
            return vertex(p);
          };
          const Index a = at(0, 0), b = at(1, 0), c = at(1, 1), d = at(0, 1);
          if (side == 0) {
            s.faces.push_back({a, d, c});
            s.faces.push_back({a, c, b});
          } else {
            s.faces.push_back({a, b, c});
            s.faces.push_back({a, c, d});
          }
        }
      }
    }
  }
  return s;
}

TriangleShape revolution(std::size_t rings, std::size_t segments, double half_length_m,
                         const std::function<double(double)>& radius_m) {
  TriangleShape s;
  const double pi = std::acos(-1.0);
  s.vertices.emplace_back(-half_length_m, 0.0, 0.0);
  for (std::size_t r = 1; r < rings; ++r) {
    // Rings lie denser towards the ends, where the profile closes.
    const double x = -half_length_m * std::cos(pi * static_cast<double>(r) / static_cast<double>(rings));
    const double radius = radius_m(x);
    for (std::size_t k = 0; k < segments; ++k) {
      const double angle = 2 * pi * static_cast<double>(k) / static_cast<double>(segments);
      s.vertices.emplace_back(x, radius * std::cos(angle), radius * std::sin(angle));
    }
  }
  s.vertices.emplace_back(half_length_m, 0.0, 0.0);
  const Index last = static_cast<Index>(s.vertices.size() - 1);
  const auto at = [&](std::size_t ring, std::size_t k) {
    return static_cast<Index>(1 + (ring - 1) * segments + k % segments);
  };
  for (std::size_t k = 0; k < segments; ++k) {
    s.faces.push_back({0, at(1, k), at(1, k + 1)});
    for (std::size_t r = 1; r + 1 < rings; ++r) {
      s.faces.push_back({at(r, k), at(r + 1, k), at(r + 1, k + 1)});
      s.faces.push_back({at(r, k), at(r + 1, k + 1), at(r, k + 1)});
    }
    s.faces.push_back({last, at(rings - 1, k + 1), at(rings - 1, k)});
  }
  return s;
}

}  // namespace test
}  // namespace dccd
