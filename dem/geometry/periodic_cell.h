#pragma once
// The periodic cell: three lengths, one shear of z planes along x, and the homogeneous velocity
// gradient that changes them.

#include <cmath>

namespace calib::dem {

/// Periodic images of the cell are addressed by code = (sx + 1) + 3 (sy + 1) + 9 (sz + 1) with
/// shifts s in {-1, 0, 1}.
inline constexpr int kImages = 27;     ///< number of codes, 3 x 3 x 3
inline constexpr int kHomeImage = 13;  ///< code of the cell itself, all shifts 0

/// Code of the image shifted by sx, sy, sz cells, each in {-1, 0, 1}.
inline constexpr int ImageCode(int sx, int sy, int sz) {
  return (sx + 1) + 3 * (sy + 1) + 9 * (sz + 1);
}

/// A cell with the lattice vectors (Lx, 0, 0), (0, Ly, 0), (tilt, 0, Lz). Adding whole lengths Lx
/// to the tilt gives the same lattice: images are found in the least tilted description, Tilt().
struct PeriodicCell {
  double length[3] = {0, 0, 0};          ///< [m]
  bool open[3] = {false, false, false};  ///< no images along this axis: grains may be anywhere, the
                                         ///< length only says where they usually are, 0 .. length
  double stretch[3] = {0, 0, 0};  ///< diagonal velocity gradient of the last move, compression
                                  ///< negative [1/s]
  double displacement = 0;  ///< of the top against the bottom along x, whole turns included [m]
  double shear = 0;         ///< velocity gradient dvx/dz of the last move [1/s]
  int turns = 0;            ///< lengths Lx of the displacement that the images leave out

  /// Volume of the cell [m^3].
  [[nodiscard]] double Volume() const { return length[0] * length[1] * length[2]; }

  /// x component of the third lattice vector, |tilt| <= Lx/2 after Reduce() [m].
  [[nodiscard]] double Tilt() const { return displacement - turns * length[0]; }

  /// Chooses the least tilted lattice; to be followed by a search of neighbours.
  void Reduce() { turns = static_cast<int>(std::lround(displacement / length[0])); }
};

}  // namespace calib::dem
