#pragma once
// The grains of one load step as a file that ParaView reads.

#include <string>

#include "absl/status/status.h"
#include "dem/dynamics/assembly.h"

namespace calib::dem {

/// Writes DIRECTORY/grains_NNNN.vtk (legacy ASCII polydata: a vertex per grain with radius, id and
/// velocity, SI units, in the order of the packing, wrapped into the cell). Makes the directory.
/// Errors: UNAVAILABLE naming the file.
absl::Status WriteVtk(const Assembly& assembly, const std::string& directory, int load_step);

}  // namespace calib::dem
