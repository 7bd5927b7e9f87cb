#include "dem/simulation/vtk_writer.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace calib::dem {

absl::Status WriteVtk(const Assembly& assembly, const std::string& directory, int load_step) {
  const ParticleArrays& p = assembly.particles();
  const PeriodicCell& cell = assembly.cell();
  const std::size_t n = p.x.size();
  std::vector<std::size_t> at(n);  // places in the arrays, by id: grains may have left
  std::iota(at.begin(), at.end(), std::size_t{0});
  std::sort(at.begin(), at.end(), [&](std::size_t a, std::size_t b) { return p.id[a] < p.id[b]; });
  const auto wrapped = [&cell](double s, int a) {
    const double length = cell.length[a];
    return cell.open[a] ? s : s - std::floor(s / length) * length;
  };

  std::string text = absl::StrFormat(
      "# vtk DataFile Version 3.0\ngrains, load step %d, periodic cell %.9g %.9g %.9g "
      "m\nASCII\nDATASET POLYDATA\n"
      "POINTS %d double\n",
      load_step, cell.length[0], cell.length[1], cell.length[2], n);
  for (const std::size_t k : at) {
    // A sheared cell, which has no open axes, wraps along (tilt, 0, Lz).
    const double layers = cell.Tilt() != 0 ? std::floor(p.z[k] / cell.length[2]) : 0;
    const double skew = (p.z[k] / cell.length[2] - layers) * cell.Tilt();
    const double x = wrapped(p.x[k] - layers * cell.Tilt() - skew, 0) + skew;
    absl::StrAppendFormat(&text, "%.12g %.12g %.12g\n", x, wrapped(p.y[k], 1), wrapped(p.z[k], 2));
  }
  absl::StrAppendFormat(&text, "VERTICES %d %d\n", n, 2 * n);
  for (std::size_t i = 0; i < n; ++i) {
    absl::StrAppendFormat(&text, "1 %d\n", i);
  }
  absl::StrAppendFormat(&text, "POINT_DATA %d\nSCALARS radius double 1\nLOOKUP_TABLE default\n", n);
  for (const std::size_t k : at) {
    absl::StrAppendFormat(&text, "%.12g\n", p.radius[k]);
  }
  text += "VECTORS velocity double\n";
  for (const std::size_t k : at) {
    absl::StrAppendFormat(&text, "%.9g %.9g %.9g\n",
                          p.vx[k] + cell.stretch[0] * p.x[k] + cell.shear * p.z[k],
                          p.vy[k] + cell.stretch[1] * p.y[k], p.vz[k] + cell.stretch[2] * p.z[k]);
  }

  std::error_code error;
  std::filesystem::create_directories(directory, error);
  const std::string path = absl::StrFormat("%s/grains_%04d.vtk", directory, load_step);
  std::ofstream file(path);
  file << text;
  file.close();
  if (error || !file) {
    return absl::UnavailableError(absl::StrCat("cannot write ", path));
  }
  return absl::OkStatus();
}

}  // namespace calib::dem
