#include "dem/particles/clump_template.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <sstream>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "dem/elementary/functions.h"
#include "dem/particles/elongation.h"
#include "dem/particles/random_numbers.h"

namespace calib::dem {
namespace {

double Distance(const Sphere& a, const Sphere& b) {
  return Hypotenuse(a.centre[0] - b.centre[0], a.centre[1] - b.centre[1],
                    a.centre[2] - b.centre[2]);
}

/// Sets the mean of the centres to the origin and scales to the volume of a unit sphere.
void Normalise(ClumpTemplate& shape) {
  const auto count = static_cast<double>(shape.spheres.size());
  const double volume = MomentsOfUnion(shape.spheres).volume;
  const double scale = CubeRoot(4.0 / 3.0 * std::numbers::pi / volume);
  for (std::size_t a = 0; a < 3; ++a) {
    double mean = 0;
    for (const Sphere& sphere : shape.spheres) {
      mean += sphere.centre[a] / count;
    }
    for (Sphere& sphere : shape.spheres) {
      sphere.centre[a] = scale * (sphere.centre[a] - mean);
    }
  }
  for (Sphere& sphere : shape.spheres) {
    sphere.radius *= scale;
  }
}

/// Index of a sphere that no chain of overlaps joins to the first; -1: there is none.
int Separate(const std::vector<Sphere>& spheres) {
  std::vector<bool> joined(spheres.size(), false);
  std::vector<std::size_t> next = {0};
  joined[0] = true;
  while (!next.empty()) {
    const std::size_t i = next.back();
    next.pop_back();
    for (std::size_t j = 0; j < spheres.size(); ++j) {
      const double reach = spheres[i].radius + spheres[j].radius;
      if (!joined[j] && Distance(spheres[i], spheres[j]) <= reach * (1 + 1e-9)) {
        joined[j] = true;
        next.push_back(j);
      }
    }
  }
  const auto apart = std::find(joined.begin(), joined.end(), false);
  return apart == joined.end() ? -1 : static_cast<int>(apart - joined.begin());
}

bool AllWithin(const std::vector<Sphere>& spheres, const Sphere& one) {
  return std::all_of(spheres.begin(), spheres.end(), [&one](const Sphere& other) {
    return Distance(one, other) + other.radius <= one.radius * (1 + 1e-9);
  });
}

}  // namespace

ClumpTemplate ParseClumpTemplate(const std::string& text, std::vector<PackingProblem>& problems) {
  ClumpTemplate shape;
  std::vector<int> line_of;
  const std::size_t before = problems.size();
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    const std::string content = line.substr(0, line.find('#'));
    const std::vector<std::string> fields =
        absl::StrSplit(content, absl::ByAnyChar(" \t\r,"), absl::SkipEmpty());
    if (fields.empty()) {
      continue;
    }
    std::array<double, 4> values{};
    bool good = fields.size() == values.size();
    for (std::size_t f = 0; good && f < values.size(); ++f) {
      good = absl::SimpleAtod(fields[f], &values[f]) && std::abs(values[f]) < 1e100;
    }
    if (!good) {
      problems.push_back(
          {number, absl::StrCat("\"", content, "\" is not a sphere, four numbers: x y z r")});
    } else if (!(values[3] > 0)) {
      problems.push_back({number, absl::StrCat("radius is ", values[3], ", it must be positive")});
    } else {
      shape.spheres.push_back({{values[0], values[1], values[2]}, values[3]});
      line_of.push_back(number);
    }
  }
  if (problems.size() > before) {
    return shape;
  }
  const std::size_t count = shape.spheres.size();
  if (count < 2 || count > kMostSpheresOfAClump) {
    problems.push_back(
        {0, absl::StrCat("found ", count, " spheres, a clump has 2 to ", kMostSpheresOfAClump)});
  } else if (const int apart = Separate(shape.spheres); apart >= 0) {
    problems.push_back({line_of[static_cast<std::size_t>(apart)],
                        "the sphere is apart from the first one: a clump is one piece"});
  } else if (std::any_of(shape.spheres.begin(), shape.spheres.end(),
                         [&](const Sphere& one) { return AllWithin(shape.spheres, one); })) {
    problems.push_back({0, "all spheres lie within one of them: the clump is a sphere"});
  } else {
    Normalise(shape);
  }
  return shape;
}

ClumpTemplate DumbbellTemplate(double aspect) {
  const Dumbbell dumbbell = DumbbellOf(aspect);
  return {
      {{{0, 0, -dumbbell.offset}, dumbbell.radius}, {{0, 0, dumbbell.offset}, dumbbell.radius}}};
}

ClumpTemplate Between(const ClumpTemplate& shape, double share) {
  if (share >= 1) {
    return shape;
  }
  ClumpTemplate between = shape;
  for (Sphere& sphere : between.spheres) {
    for (double& x : sphere.centre) {
      x *= share;
    }
    sphere.radius = 1 + share * (sphere.radius - 1);
  }
  Normalise(between);
  return between;
}

double ReachOf(const ClumpTemplate& shape) {
  double reach = 0;
  for (const Sphere& sphere : shape.spheres) {
    reach = std::max(
        reach, Hypotenuse(sphere.centre[0], sphere.centre[1], sphere.centre[2]) + sphere.radius);
  }
  return reach;
}

Rotation DrawRotation(std::uint64_t seed, int grain, int draw) {
  const auto u = Uniform(seed, kOrientationDraw, grain, draw);
  const double a = std::sqrt(1.0 - u[0]);
  const double b = std::sqrt(u[0]);
  const double x = a * Sine(2.0 * std::numbers::pi * u[1]);
  const double y = a * Cosine(2.0 * std::numbers::pi * u[1]);
  const double z = b * Sine(2.0 * std::numbers::pi * u[2]);
  const double w = b * Cosine(2.0 * std::numbers::pi * u[2]);
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
           {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
           {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
}

Rotation DrawRotationInPlane(std::uint64_t seed, int grain, int draw) {
  const double angle = 2.0 * std::numbers::pi * Uniform(seed, kOrientationDraw, grain, draw)[0];
  const double c = Cosine(angle);
  const double s = Sine(angle);
  return {{{c, 0, s}, {0, 1, 0}, {-s, 0, c}}};
}

Rotation LaidDown(double angle) {
  const double c = Cosine(angle);
  const double s = Sine(angle);
  return {{{-s, 0, c}, {c, 0, s}, {0, 1, 0}}};
}

Sphere Placed(const Sphere& member, const Rotation& rotation, double radius,
              const std::array<double, 3>& centre) {
  Sphere placed{.centre = centre, .radius = radius * member.radius};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    placed.centre[axis] +=
        radius * (rotation[axis][0] * member.centre[0] + rotation[axis][1] * member.centre[1] +
                  rotation[axis][2] * member.centre[2]);
  }
  return placed;
}

Packing Replaced(const Packing& spheres, const ClumpTemplate& shape, std::uint64_t seed) {
  Packing packing;
  std::copy(std::begin(spheres.length), std::end(spheres.length), std::begin(packing.length));
  for (std::size_t i = 0; i < spheres.x.size(); ++i) {
    const Rotation rotation = DrawRotation(seed, static_cast<int>(i), 0);
    for (const Sphere& member : shape.spheres) {
      const Sphere placed =
          Placed(member, rotation, spheres.radius[i], {spheres.x[i], spheres.y[i], spheres.z[i]});
      packing.x.push_back(placed.centre[0]);
      packing.y.push_back(placed.centre[1]);
      packing.z.push_back(placed.centre[2]);
      packing.radius.push_back(placed.radius);
      packing.clump.push_back(static_cast<int>(i));
    }
  }
  return packing;
}

}  // namespace calib::dem
