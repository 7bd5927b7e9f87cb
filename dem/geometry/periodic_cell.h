#pragma once
// The orthorhombic periodic cell: three lengths and the homogeneous velocity gradient that changes
// them.

namespace calib::dem {

/// Images are addressed by code = (sx + 1) + 3 (sy + 1) + 9 (sz + 1) with shifts s in {-1, 0, 1}.
inline constexpr int kImages = 27;
inline constexpr int kHomeImage = 13;

inline constexpr int ImageCode(int sx, int sy, int sz) {
  return (sx + 1) + 3 * (sy + 1) + 9 * (sz + 1);
}

struct PeriodicCell {
  double length[3] = {0, 0, 0};          ///< [m]
  bool open[3] = {false, false, false};  ///< no images along this axis: grains may be anywhere, the
                                         ///< length only says where they usually are, 0 .. length
  double stretch[3] = {0, 0,
                       0};  ///< velocity gradient of the last move, compression negative [1/s]

  [[nodiscard]] double Volume() const { return length[0] * length[1] * length[2]; }
};

}  // namespace calib::dem
