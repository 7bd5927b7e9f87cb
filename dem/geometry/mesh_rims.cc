#include "dem/geometry/mesh_rims.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"

namespace calib::dem {
namespace {

/// Distance from a plane or line, over the mesh's size, within which a rim is flat or straight [-].
/// Chosen: as nearly as meshes are drawn.
constexpr double kFlat = 1e-3;

using Loop = std::vector<Vec3>;

std::string Text(const Vec3& p) { return absl::StrCat("(", p.x, ", ", p.y, ", ", p.z, ") m"); }

Vec3 MiddleOf(const Loop& loop) {
  Vec3 sum{};
  for (const Vec3& v : loop) {
    sum = sum + v;
  }
  return (1.0 / static_cast<double>(loop.size())) * sum;
}

double LengthAround(const Loop& loop) {
  double length = 0;
  for (std::size_t k = 0; k < loop.size(); ++k) {
    length += Length(loop[(k + 1) % loop.size()] - loop[k]);
  }
  return length;
}

/// The loops that edges of one triangle form, the longest first; `problem` says where they are
/// none.
std::vector<Loop> OpenLoops(const TriangleMesh& mesh, std::string& problem) {
  const std::vector<int> place = PlacesOf(mesh);
  std::map<int, Vec3> where;
  std::map<std::pair<int, int>, int> edges;
  for (const auto& corner : mesh.triangle) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto v = static_cast<std::size_t>(corner[k]);
      const auto next = static_cast<std::size_t>(corner[(k + 1) % 3]);
      where.emplace(place[v], mesh.vertex[v]);
      ++edges[std::minmax(place[v], place[next])];
    }
  }
  std::map<int, std::vector<int>> open;  // a place and those that open edges lead to
  for (const auto& [ends, triangles] : edges) {
    if (triangles == 1) {
      open[ends.first].push_back(ends.second);
      open[ends.second].push_back(ends.first);
    }
  }
  for (const auto& [at, ends] : open) {
    if (ends.size() != 2) {
      problem = absl::StrCat("has a hole or a notch that touches a rim or another one at ",
                             Text(where.at(at)), ": ", ends.size(),
                             " edges of one triangle only meet there");
      return {};
    }
  }
  std::vector<Loop> loops;
  while (!open.empty()) {
    Loop loop;
    int at = open.begin()->first;
    int from = -1;
    while (true) {
      const auto here = open.find(at);
      if (here == open.end()) {
        break;
      }
      loop.push_back(where.at(at));
      const int next = here->second[0] != from ? here->second[0] : here->second[1];
      open.erase(here);
      from = at;
      at = next;
    }
    loops.push_back(std::move(loop));
  }
  std::stable_sort(loops.begin(), loops.end(),
                   [](const Loop& a, const Loop& b) { return LengthAround(a) > LengthAround(b); });
  return loops;
}

/// "3 loops of edges of one triangle, the shortest of 3 edges around (..) m".
std::string Found(const std::vector<Loop>& loops) {
  return absl::StrCat(loops.size(), loops.size() == 1 ? " loop" : " loops",
                      " of edges of one triangle only, the shortest of ", loops.back().size(),
                      " edges around ", Text(MiddleOf(loops.back())));
}

double LowestOf(const Loop& loop) {
  return std::min_element(loop.begin(), loop.end(),
                          [](const Vec3& a, const Vec3& b) { return a.z < b.z; })
      ->z;
}

double HighestOf(const Loop& loop) {
  return std::max_element(loop.begin(), loop.end(),
                          [](const Vec3& a, const Vec3& b) { return a.z < b.z; })
      ->z;
}

/// A corner that lies outside the plane of the others; the plane is that of the loop's area.
std::optional<Vec3> OffPlane(const Loop& loop) {
  const Vec3 middle = MiddleOf(loop);
  Vec3 normal{};
  double size = 0;
  for (std::size_t k = 0; k < loop.size(); ++k) {
    normal = normal + Cross(loop[k] - middle, loop[(k + 1) % loop.size()] - middle);
    size = std::max(size, Length(loop[k] - middle));
  }
  normal = (1.0 / Length(normal)) * normal;
  std::optional<Vec3> worst;
  double farthest = kFlat * size;
  for (const Vec3& v : loop) {
    const double off = std::abs(Dot(normal, v - middle));
    if (!(off <= farthest)) {
      farthest = off;
      worst = v;
    }
  }
  return worst;
}

/// -1, 1: beyond the slice; 0: within.
int SideOf(double y, double reach) { return y <= -reach ? -1 : (y >= reach ? 1 : 0); }

}  // namespace

std::string FunnelProblem(const TriangleMesh& mesh) {
  std::string problem;
  const std::vector<Loop> loops = OpenLoops(mesh, problem);
  if (!problem.empty() || loops.empty()) {
    return problem;
  }
  if (loops.size() != 2) {
    return absl::StrCat(loops.size() > 2 ? "has a hole: it has " : "has ", Found(loops),
                        "; a funnel has two, its inlet and its outlet, or none as a solid");
  }
  const bool first_lower = MiddleOf(loops[0]).z < MiddleOf(loops[1]).z;
  const Loop& outlet = first_lower ? loops[0] : loops[1];
  const Loop& inlet = first_lower ? loops[1] : loops[0];
  const Bounds bounds = BoundsOf(mesh);
  const double level = kFlat * (bounds.high.z - bounds.low.z);
  if (LowestOf(outlet) > bounds.low.z + level || HighestOf(inlet) < bounds.high.z - level) {
    const bool low = LowestOf(outlet) > bounds.low.z + level;
    const Loop& hole = low ? outlet : inlet;
    return absl::StrCat("has a hole in place of its ", low ? "outlet" : "inlet", ": a loop of ",
                        hole.size(), " edges around ", Text(MiddleOf(hole)),
                        low ? ", not at its lower end" : ", not at its upper end");
  }
  for (const Loop& rim : loops) {
    if (const auto off = OffPlane(rim)) {
      return absl::StrCat("has a notch in its ", &rim == &outlet ? "outlet" : "inlet", " at ",
                          Text(*off), ": its rim of ", rim.size(), " edges is not flat there");
    }
  }
  return "";
}

std::string SlideProblem(const TriangleMesh& mesh) {
  std::string problem;
  const std::vector<Loop> loops = OpenLoops(mesh, problem);
  if (problem.empty() && loops.size() > 1) {
    return absl::StrCat("has a hole: it has ", Found(loops),
                        "; a slide has one, its outline, or none as a solid");
  }
  return problem;
}

std::string SlideProblemAcross(const TriangleMesh& mesh, double reach) {
  std::string problem;
  const std::vector<Loop> loops = OpenLoops(mesh, problem);
  if (loops.empty()) {
    return problem;
  }
  const Loop& outline = loops.front();
  const auto start = std::find_if(outline.begin(), outline.end(),
                                  [reach](const Vec3& v) { return SideOf(v.y, reach) != 0; });
  if (start == outline.end()) {
    return "ends within the slice on every side";
  }
  const Bounds bounds = BoundsOf(mesh);
  const double straight = kFlat * (bounds.high.x - bounds.low.x);
  const auto first = static_cast<std::size_t>(start - outline.begin());
  int ends = 0;
  int side = SideOf(start->y, reach);  // from which the present part within the slice began
  double least = 0;
  double largest = 0;
  bool within = false;
  const auto meet = [&](double x) {
    least = within ? std::min(least, x) : x;
    largest = within ? std::max(largest, x) : x;
    within = true;
  };
  for (std::size_t k = 0; k < outline.size(); ++k) {
    const Vec3& a = outline[(first + k) % outline.size()];
    const Vec3& b = outline[(first + k + 1) % outline.size()];
    const int here = SideOf(a.y, reach);
    const int there = SideOf(b.y, reach);
    if (here == there && here != 0) {
      continue;
    }
    const auto crossing = [&](int at) {
      return a.x + (b.x - a.x) * (at * reach - a.y) / (b.y - a.y);
    };
    if (here != 0) {
      side = here;
      meet(crossing(here));
    }
    if (there == 0) {
      meet(b.x);
      continue;
    }
    meet(crossing(there));
    within = false;
    if (there == side) {
      return absl::StrCat("has a notch in its side near ", Text(b), ": within ", reach,
                          " m of its middle along y it has to have no gap");
    }
    if (largest - least > straight) {
      return absl::StrCat("has a notch, or an end that is not straight across the slice, from x = ",
                          least, " to ", largest, " m near ", Text(b));
    }
    ++ends;
  }
  return ends == 2 ? "" : absl::StrCat("has ", ends, " ends across the slice, it needs two");
}

}  // namespace calib::dem
