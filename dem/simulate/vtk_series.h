#pragma once
// What ParaView shows of a run: grains, contacts and walls after each load step.

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "dem/dynamics/assembly.h"
#include "dem/simulate/vtk_xml.h"

namespace calib::dem {

/// Series in one folder, each a PVD that names its files with their load steps as time:
///   grains.pvd    grains_NNNN.vtu    a vertex per grain in the order of the packing: id,
///                                    radius [m], velocity [m/s], angular_velocity [rad/s],
///                                    coordination_number (contacts with grains), clump where
///                                    there are some (-1: none); field data load_step,
///                                    cell_length [m], cell_tilt [m]
///   contacts.pvd  contacts_NNNN.vtp  a line per contact of grains from centre to centre:
///                                    force on the grain at its end, as a vector; normal_force
///                                    (compression positive), tangential_force [N];
///                                    first_grain, second_grain: ids of those it joins
///   cell.pvd      cell_NNNN.vtp      the edges of the periodic cell; field data load_step, stress:
///                                    Love-Weber along x, y, z, compression positive [Pa]; only
///                                    where the cell is closed on all sides
///   walls.pvd     walls_NNNN.vtp     the triangles of walls that are meshes; only with such walls
/// Centres are wrapped into the periodic cell. Every file appears as a whole, and a PVD names only
/// files that are there, so that a run can be looked at while it goes on. Not thread-safe.
class VtkSeries {
 public:
  /// directory: made by the first Add().
  explicit VtkSeries(std::string directory) : directory_(std::move(directory)) {}

  /// Writes the files of a load step >= 0. Errors: UNAVAILABLE naming the file.
  absl::Status Add(const Assembly& assembly, int load_step);

  /// Adds a load step that was written before an interruption to the series, where its files are
  /// there.
  void AddExisting(int load_step);

 private:
  struct Series {
    std::string name, extension;
    std::vector<VtkSeriesEntry> entries{};
  };
  [[nodiscard]] static VtkSeriesEntry EntryOf(const Series& series, int load_step);
  absl::Status Write(Series& series, int load_step, const VtkPiece& piece) const;

  std::string directory_;
  Series grains_{"grains", "vtu"};
  Series contacts_{"contacts", "vtp"};
  Series cell_{"cell", "vtp"};
  Series walls_{"walls", "vtp"};
};

}  // namespace calib::dem
