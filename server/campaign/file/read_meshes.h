#pragma once
// The key `meshes` of an experiment.

#include <map>
#include <string>

#include "dem/registry/catalog.h"
#include "server/campaign/file/shared/read_context.h"

namespace calib::campaign {

/// {PIECE: {file: F, unit: mm}, ...}: STL files in place of pieces of the test's boundary, by the
/// names of the catalogue. STL knows no unit, so that it has to be said. Pieces with problems are
/// left out.
std::map<std::string, MeshFile> ReadMeshes(MapReader& experiment, const dem::TestInfo& test,
                                           ReadContext& context);

}  // namespace calib::campaign
