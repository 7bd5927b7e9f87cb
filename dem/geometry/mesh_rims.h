#pragma once
// Where a mesh that is no closed body ends: its rims, and the holes among them.

#include <string>
#include <vector>

#include "dem/geometry/triangle_mesh.h"

namespace calib::dem {

/// What is wrong with a mesh as a funnel, in a sentence that goes on from its name; empty: nothing.
/// A funnel is closed (a solid with its thickness), or a sheet whose edges of one triangle form two
/// rims, flat within 1e-3 of their size: an outlet with its lowest and an inlet with its highest
/// point. Precondition: MeshProblems() finds nothing.
std::string FunnelProblem(const TriangleMesh& mesh);

/// What is wrong with a mesh as a slide, in a sentence that goes on from its name; empty: nothing.
/// A slide is a closed body, or a sheet whose edges of one triangle form one outline. Precondition:
/// MeshProblems() finds nothing.
std::string SlideProblem(const TriangleMesh& mesh);

/// What is wrong with a slide where grains slide on it, at y in [-reach, reach] [m], in a sentence
/// that goes on from its name; empty: nothing. The sides of its outline have to lie outside this
/// strip, and two ends cross it, straight along y within 1e-3 of the slide's length. Precondition:
/// SlideProblem() finds nothing.
std::string SlideProblemAcross(const TriangleMesh& mesh, double reach);

}  // namespace calib::dem
