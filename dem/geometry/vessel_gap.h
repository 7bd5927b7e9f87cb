#pragma once
// Holes in the wall of a vessel that stands around the vertical through the origin.

#include <string>

#include "dem/geometry/triangle_mesh.h"

namespace calib::dem {

/// What is wrong with a mesh as a vessel open at the top and the bottom, in a sentence that goes on
/// from its name; empty: nothing. At its foot the vessel surrounds the origin, and nothing closes
/// it there; from places above it wall is seen in every horizontal direction. Where the mesh ends
/// at the top in a rim that is not level, its lower parts see nothing up to the top, which is no
/// hole. Looked at are the heights of edges of one triangle only, where alone a surface can have
/// holes; where the vessel leaves the vertical nothing is said, nor of holes in level parts.
/// Precondition: MeshProblems() finds nothing.
std::string VesselProblem(const TriangleMesh& mesh);

}  // namespace calib::dem
