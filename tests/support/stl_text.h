#pragma once
// STL files for tests: four-sided funnels and vessels, in both forms.

#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace calib::testing {

struct FunnelShape {
  double lower = 0;     ///< half a side of the lower opening, in units of the file
  double upper = 0;     ///< of the upper one
  double height = 0;    ///< above z = 0
  double middle_y = 0;  ///< of both
};

using StlPoint = std::array<double, 3>;
using StlTriangle = std::array<StlPoint, 3>;

/// Its four walls, open at both ends.
inline std::vector<StlTriangle> FourSides(const FunnelShape& f) {
  constexpr std::array<std::array<int, 2>, 5> kCorners = {
      {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}, {-1, -1}}};
  const auto corner = [&](std::size_t k, bool up) {
    const double half = up ? f.upper : f.lower;
    return StlPoint{half * kCorners[k][0], f.middle_y + half * kCorners[k][1], up ? f.height : 0};
  };
  std::vector<StlTriangle> triangles;
  for (std::size_t k = 0; k < 4; ++k) {
    triangles.push_back({corner(k, false), corner(k + 1, false), corner(k + 1, true)});
    triangles.push_back({corner(k, false), corner(k + 1, true), corner(k, true)});
  }
  return triangles;
}

inline std::string TextStl(const std::vector<StlTriangle>& triangles) {
  std::string text = "solid test\n";
  for (const StlTriangle& triangle : triangles) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const StlPoint& p : triangle) {
      text += "vertex " + std::to_string(p[0]) + " " + std::to_string(p[1]) + " " +
              std::to_string(p[2]) + "\n";
    }
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid test\n";
}

/// Its header holds bytes that are no UTF-8, as those of some programs do.
inline std::string BinaryStl(const std::vector<StlTriangle>& triangles) {
  std::string bytes(80, '\xff');
  const auto add = [&bytes](std::uint32_t word) {
    for (int k = 0; k < 4; ++k) bytes.push_back(static_cast<char>((word >> (8 * k)) & 0xFFU));
  };
  add(static_cast<std::uint32_t>(triangles.size()));
  for (const StlTriangle& triangle : triangles) {
    for (int k = 0; k < 3; ++k) add(0);
    for (const StlPoint& p : triangle) {
      for (const double coordinate : p) {
        const auto value = static_cast<float>(coordinate);
        std::uint32_t word = 0;
        std::memcpy(&word, &value, sizeof word);
        add(word);
      }
    }
    bytes.append(2, '\0');
  }
  return bytes;
}

}  // namespace calib::testing
