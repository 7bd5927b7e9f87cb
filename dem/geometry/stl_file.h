#pragma once
// Triangle meshes from STL files.

#include <string>
#include <vector>

#include "dem/geometry/triangle_mesh.h"

namespace calib::dem {

/// One thing wrong in an STL file. line is 1-based in the text form; 0: the file as a whole.
struct StlProblem {
  int line = 0;
  std::string message;
};

/// Reads the content of an STL file, text ("solid ... facet normal ... vertex x y z ...") or binary
/// (80 bytes of header, count, 50 bytes per triangle), told apart by the length that the binary
/// count announces. Coordinates are multiplied by `scale` [m per unit of the file] > 0; stored
/// normals are not used. Appends everything wrong to problems, with MeshProblems() of a surface
/// that is `closed` or not; the result is meaningful only if none was added.
TriangleMesh ParseStl(const std::string& content, double scale, bool closed,
                      std::vector<StlProblem>& problems);

}  // namespace calib::dem
