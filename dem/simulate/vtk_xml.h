#pragma once
// VTK XML documents (VTU, VTP, PVD) as text: inline base64 data, exact to the last bit.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "dem/geometry/vector3.h"

namespace calib::dem {

/// One <DataArray>; the type follows from the values.
std::string VtkArray(const std::string& name, const std::vector<double>& values);
std::string VtkArray(const std::string& name, const std::vector<std::int32_t>& values);
std::string VtkArray(const std::string& name, const std::vector<std::int64_t>& values);
std::string VtkArray(const std::string& name, const std::vector<std::uint8_t>& values);
/// Three components per value.
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
std::string VtkDocument(const VtkPiece& piece);

/// A PVD: the files of a series with the time at which ParaView shows each.
struct VtkSeriesEntry {
  int load_step = 0;
  std::string file;  ///< relative to the PVD
};
std::string VtkCollection(const std::vector<VtkSeriesEntry>& entries);

}  // namespace calib::dem
