#include "dem/simulate/vtk_series.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/return_if_error.h"
#include "dem/simulate/whole_file.h"

namespace calib::dem {
namespace {

std::size_t Index(int grain) { return static_cast<std::size_t>(grain); }

/// A centre in the cell. A sheared cell, which has no open axes, wraps along (tilt, 0, Lz).
Vec3 Wrapped(const Vec3& at, const PeriodicCell& cell) {
  const auto into = [&cell](double s, int a) {
    const double length = cell.length[a];
    return cell.open[a] ? s : s - std::floor(s / length) * length;
  };
  const double layers = cell.Tilt() != 0 ? std::floor(at.z / cell.length[2]) : 0;
  const double skew = (at.z / cell.length[2] - layers) * cell.Tilt();
  return {into(at.x - layers * cell.Tilt() - skew, 0) + skew, into(at.y, 1), into(at.z, 2)};
}

Vec3 CentreOf(const Assembly& assembly, std::size_t grain) {
  const ParticleArrays& p = assembly.particles();
  return Wrapped({p.x[grain], p.y[grain], p.z[grain]}, assembly.cell());
}

/// Of slot s, from the centre of its grain i to that of j.
Vec3 Branch(const Assembly& assembly, std::size_t s) {
  const ParticleArrays& p = assembly.particles();
  const PeriodicCell& cell = assembly.cell();
  const NeighborList& list = assembly.neighbors();
  const std::size_t i = Index(list.first[s]);
  const std::size_t j = Index(list.second[s]);
  const int code = list.image[s];
  const int layer = code / 9 - 1;
  return {p.x[j] - p.x[i] + (code % 3 - 1) * cell.length[0] + layer * cell.Tilt(),
          p.y[j] - p.y[i] + (code / 3 % 3 - 1) * cell.length[1],
          p.z[j] - p.z[i] + layer * cell.length[2]};
}

std::vector<std::int32_t> CoordinationNumbers(const Assembly& assembly) {
  const NeighborList& list = assembly.neighbors();
  std::vector<std::int32_t> contacts(assembly.particles().x.size(), 0);
  for (int s = 0; s < list.size(); ++s) {
    if (assembly.touching(s)) {
      ++contacts[Index(list.first[Index(s)])];
      ++contacts[Index(list.second[Index(s)])];
    }
  }
  return contacts;
}

std::vector<std::int64_t> Counted(std::size_t n, std::int64_t from, std::int64_t by) {
  std::vector<std::int64_t> numbers(n);
  for (std::size_t k = 0; k < n; ++k) {
    numbers[k] = from + by * static_cast<std::int64_t>(k);
  }
  return numbers;
}

VtkPiece GrainsOf(const Assembly& assembly, int load_step) {
  const ParticleArrays& p = assembly.particles();
  const PeriodicCell& cell = assembly.cell();
  const std::size_t n = p.x.size();
  std::vector<std::size_t> at(n);  // places in the arrays, by id: grains may have left
  std::iota(at.begin(), at.end(), std::size_t{0});
  std::sort(at.begin(), at.end(), [&](std::size_t a, std::size_t b) { return p.id[a] < p.id[b]; });
  const auto ordered = [&at](const auto& values) {
    auto result = values;
    for (std::size_t k = 0; k < at.size(); ++k) {
      result[k] = values[at[k]];
    }
    return result;
  };
  VtkPiece piece;
  std::vector<Vec3> velocity;
  std::vector<Vec3> spin;
  for (const std::size_t g : at) {
    piece.points.push_back(CentreOf(assembly, g));
    velocity.push_back({p.vx[g] + cell.stretch[0] * p.x[g] + cell.shear * p.z[g],
                        p.vy[g] + cell.stretch[1] * p.y[g], p.vz[g] + cell.stretch[2] * p.z[g]});
    spin.push_back({p.wx[g], p.wy[g], p.wz[g]});
  }
  piece.connectivity = Counted(n, 0, 1);
  piece.offsets = Counted(n, 1, 1);
  piece.point_data = VtkArray("id", ordered(p.id)) + VtkArray("radius", ordered(p.radius)) +
                     VtkArray("velocity", velocity) + VtkArray("angular_velocity", spin) +
                     VtkArray("coordination_number", ordered(CoordinationNumbers(assembly)));
  if (!p.body.empty()) {
    piece.point_data += VtkArray("clump", ordered(p.body));
  }
  piece.field_data =
      VtkArray("load_step", std::vector<std::int32_t>{load_step}) +
      VtkArray("cell_length", std::vector<Vec3>{{cell.length[0], cell.length[1], cell.length[2]}}) +
      VtkArray("cell_tilt", std::vector<double>{cell.Tilt()});
  return piece;
}

VtkPiece ContactsOf(const Assembly& assembly) {
  const NeighborList& list = assembly.neighbors();
  VtkPiece piece{.cells = VtkPiece::Cells::kLines};
  std::vector<Vec3> forces;
  std::vector<double> normal;
  std::vector<double> tangential;
  std::vector<std::int32_t> first;
  std::vector<std::int32_t> second;
  for (int s = 0; s < list.size(); ++s) {
    if (!assembly.touching(s)) {
      continue;
    }
    const Vec3 from = CentreOf(assembly, Index(list.first[Index(s)]));
    const Vec3 branch = Branch(assembly, Index(s));
    piece.points.push_back(from);
    piece.points.push_back(from + branch);
    const Vec3 force = assembly.force_on_j(s);
    const Vec3 n = (1.0 / Length(branch)) * branch;
    forces.push_back(force);
    first.push_back(assembly.particles().id[Index(list.first[Index(s)])]);
    second.push_back(assembly.particles().id[Index(list.second[Index(s)])]);
    normal.push_back(Dot(force, n));
    tangential.push_back(Length(force - normal.back() * n));
  }
  piece.connectivity = Counted(piece.points.size(), 0, 1);
  piece.offsets = Counted(normal.size(), 2, 2);
  piece.cell_data = VtkArray("force", forces) + VtkArray("normal_force", normal) +
                    VtkArray("tangential_force", tangential) + VtkArray("first_grain", first) +
                    VtkArray("second_grain", second);
  return piece;
}

/// No points where an axis is open.
VtkPiece CellOf(const Assembly& assembly, int load_step) {
  const PeriodicCell& cell = assembly.cell();
  VtkPiece piece{.cells = VtkPiece::Cells::kLines};
  if (cell.open[0] || cell.open[1] || cell.open[2]) {
    return piece;
  }
  for (int corner = 0; corner < 8; ++corner) {  // bit a: at the far end along axis a
    const double top = corner >> 2 & 1;
    piece.points.push_back({(corner & 1) * cell.length[0] + top * cell.Tilt(),
                            (corner >> 1 & 1) * cell.length[1], top * cell.length[2]});
    for (const int axis : {1, 2, 4}) {
      if ((corner & axis) == 0) {
        piece.connectivity.insert(piece.connectivity.end(), {corner, corner | axis});
      }
    }
  }
  piece.offsets = Counted(12, 2, 2);
  const std::array<double, 3>& stress = assembly.stress();
  piece.field_data = VtkArray("load_step", std::vector<std::int32_t>{load_step}) +
                     VtkArray("stress", std::vector<Vec3>{{stress[0], stress[1], stress[2]}});
  return piece;
}

/// No points where no wall is a mesh.
VtkPiece WallsOf(const Assembly& assembly) {
  VtkPiece piece{.cells = VtkPiece::Cells::kPolygons};
  std::vector<std::int32_t> wall;
  const std::vector<Wall>& walls = assembly.walls().walls();
  for (std::size_t w = 0; w < walls.size(); ++w) {
    if (!walls[w].active) {
      continue;
    }
    const auto first = static_cast<std::int64_t>(piece.points.size());
    const TriangleMesh& mesh = walls[w].mesh;
    piece.points.insert(piece.points.end(), mesh.vertex.begin(), mesh.vertex.end());
    for (const auto& corners : mesh.triangle) {
      for (const int corner : corners) {
        piece.connectivity.push_back(first + corner);
      }
      wall.push_back(static_cast<std::int32_t>(w));
    }
  }
  piece.offsets = Counted(wall.size(), 3, 3);
  piece.cell_data = VtkArray("wall", wall);
  return piece;
}

}  // namespace

VtkSeriesEntry VtkSeries::EntryOf(const Series& series, int load_step) {
  return {.load_step = load_step,
          .file = absl::StrFormat("%s_%04d.%s", series.name, load_step, series.extension)};
}

absl::Status VtkSeries::Write(Series& series, int load_step, const VtkPiece& piece) const {
  const VtkSeriesEntry entry = EntryOf(series, load_step);
  RETURN_IF_ERROR(WriteWholeFile(absl::StrCat(directory_, "/", entry.file), VtkDocument(piece)));
  series.entries.push_back(entry);
  return WriteWholeFile(absl::StrCat(directory_, "/", series.name, ".pvd"),
                        VtkCollection(series.entries));
}

absl::Status VtkSeries::Add(const Assembly& assembly, int load_step) {
  std::error_code error;  // shows when the first file cannot be written
  std::filesystem::create_directories(directory_, error);
  RETURN_IF_ERROR(Write(grains_, load_step, GrainsOf(assembly, load_step)));
  RETURN_IF_ERROR(Write(contacts_, load_step, ContactsOf(assembly)));
  if (const VtkPiece cell = CellOf(assembly, load_step); !cell.points.empty()) {
    RETURN_IF_ERROR(Write(cell_, load_step, cell));
  }
  const VtkPiece walls = WallsOf(assembly);
  return walls.points.empty() ? absl::OkStatus() : Write(walls_, load_step, walls);
}

void VtkSeries::AddExisting(int load_step) {
  for (Series* series : {&grains_, &contacts_, &cell_, &walls_}) {
    const VtkSeriesEntry entry = EntryOf(*series, load_step);
    std::error_code error;
    if (std::filesystem::exists(absl::StrCat(directory_, "/", entry.file), error)) {
      series->entries.push_back(entry);
    }
  }
}

}  // namespace calib::dem
