#pragma once
// VTK XML documents (VTU, VTP, PVD) as text: inline base64 data, exact to the last bit.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "dem/geometry/vector3.h"

namespace calib::dem {

/// One <DataArray> of the values; its type follows from theirs. All functions here are pure and
/// never fail.
std::string VtkArray(const std::string& name, const std::vector<double>& values);
std::string VtkArray(const std::string& name, const std::vector<std::int32_t>& values);
std::string VtkArray(const std::string& name, const std::vector<std::int64_t>& values);
std::string VtkArray(const std::string& name, const std::vector<std::uint8_t>& values);
/// One <DataArray> with three components per value.
std::string VtkArray(const std::string& name, const std::vector<Vec3>& values);

/// A document of one piece. Cells are those of `connectivity` and `offsets` (ends), of one type.
struct VtkPiece {
  enum class Cells {
    kVertices,  ///< a VTU, UnstructuredGrid
    kLines,     ///< a VTP, PolyData
    kPolygons,  ///< a VTP, PolyData
  };
  Cells cells = Cells::kVertices;
  std::vector<Vec3> points{};
  std::vector<std::int64_t> connectivity{}, offsets{};
  std::string field_data{};  ///< arrays of the whole, by VtkArray()
  std::string point_data{};  ///< arrays with a value per point
  std::string cell_data{};   ///< arrays with a value per cell
};
/// The document of a piece as text.
std::string VtkDocument(const VtkPiece& piece);

/// One file of a series and the time at which ParaView shows it.
struct VtkSeriesEntry {
  int load_step = 0;  ///< the time
  std::string file;   ///< relative to the PVD
};
/// A PVD document, which names the files of a series, as text.
std::string VtkCollection(const std::vector<VtkSeriesEntry>& entries);

}  // namespace calib::dem
