#include "dem/simulate/vtk_xml.h"

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"

namespace calib::dem {
namespace {

/// Type of a cell that is a vertex: VTK_VERTEX of the VTK file formats.
constexpr std::uint8_t kVertexCell = 1;

/// Length in bytes in front, then the values as they lie in memory, base64 as one.
template <class T>
std::string Array(const std::string& name, const char* type, int components,
                  const std::vector<T>& values) {
  const std::uint64_t length = values.size() * sizeof(T);
  std::string bytes(reinterpret_cast<const char*>(&length), sizeof length);
  bytes.append(reinterpret_cast<const char*>(values.data()), length);
  std::string text;
  absl::Base64Escape(bytes, &text);
  return absl::StrCat("<DataArray type=\"", type, "\" Name=\"", name, "\" NumberOfComponents=\"",
                      components, "\" NumberOfTuples=\"", values.size(), "\" format=\"binary\">",
                      text, "</DataArray>\n");
}

std::string Document(const char* type, const std::string& inside) {
  return absl::StrCat("<?xml version=\"1.0\"?>\n<VTKFile type=\"", type,
                      "\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<",
                      type, ">\n", inside, "</", type, ">\n</VTKFile>\n");
}

}  // namespace

std::string VtkArray(const std::string& name, const std::vector<double>& values) {
  return Array(name, "Float64", 1, values);
}
std::string VtkArray(const std::string& name, const std::vector<std::int32_t>& values) {
  return Array(name, "Int32", 1, values);
}
std::string VtkArray(const std::string& name, const std::vector<std::int64_t>& values) {
  return Array(name, "Int64", 1, values);
}
std::string VtkArray(const std::string& name, const std::vector<std::uint8_t>& values) {
  return Array(name, "UInt8", 1, values);
}
std::string VtkArray(const std::string& name, const std::vector<Vec3>& values) {
  static_assert(sizeof(Vec3) == 3 * sizeof(double));
  return Array(name, "Float64", 3, values);
}

std::string VtkDocument(const VtkPiece& piece) {
  const std::size_t cells = piece.offsets.size();
  const std::string connectivity =
      VtkArray("connectivity", piece.connectivity) + VtkArray("offsets", piece.offsets);
  const std::string data =
      absl::StrCat("<PointData>\n", piece.point_data, "</PointData>\n<CellData>\n", piece.cell_data,
                   "</CellData>\n<Points>\n", VtkArray("points", piece.points), "</Points>\n");
  const std::string field = absl::StrCat("<FieldData>\n", piece.field_data, "</FieldData>\n");
  if (piece.cells == VtkPiece::Cells::kVertices) {
    const std::vector<std::uint8_t> types(cells, kVertexCell);
    return Document("UnstructuredGrid",
                    absl::StrCat(field, "<Piece NumberOfPoints=\"", piece.points.size(),
                                 "\" NumberOfCells=\"", cells, "\">\n", data, "<Cells>\n",
                                 connectivity, VtkArray("types", types), "</Cells>\n</Piece>\n"));
  }
  const bool lines = piece.cells == VtkPiece::Cells::kLines;
  const char* const name = lines ? "Lines" : "Polys";
  return Document(
      "PolyData",
      absl::StrCat(field, "<Piece NumberOfPoints=\"", piece.points.size(),
                   "\" NumberOfVerts=\"0\" NumberOfLines=\"", lines ? cells : 0,
                   "\" NumberOfStrips=\"0\" NumberOfPolys=\"", lines ? 0 : cells, "\">\n", data,
                   "<", name, ">\n", connectivity, "</", name, ">\n</Piece>\n"));
}

std::string VtkCollection(const std::vector<VtkSeriesEntry>& entries) {
  std::string sets;
  for (const VtkSeriesEntry& entry : entries) {
    absl::StrAppend(&sets, "<DataSet timestep=\"", entry.load_step, "\" part=\"0\" file=\"",
                    entry.file, "\"/>\n");
  }
  return Document("Collection", sets);
}

}  // namespace calib::dem
