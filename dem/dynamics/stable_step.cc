#include "dem/dynamics/stable_step.h"

#include <cmath>
#include <limits>

namespace calib::dem {
namespace {

/// Symmetric, of order three: xx, yy, zz, xy, yz, zx.
using Symmetric = std::array<double, 6>;

using Matrix = std::array<std::array<double, 3>, 3>;

/// At least the largest eigenvalue: a third of the trace and sqrt(2/3) of the norm of the deviator,
/// which it is where the other two are equal.
double LargestEigenvalueBound(const Symmetric& s) {
  const double mean = (s[0] + s[1] + s[2]) / 3.0;
  double squares = 2.0 * (s[3] * s[3] + s[4] * s[4] + s[5] * s[5]);
  for (std::size_t a = 0; a < 3; ++a) {
    squares += (s[a] - mean) * (s[a] - mean);
  }
  return mean + std::sqrt(2.0 / 3.0 * squares);
}

/// Of the whole matrix of two blocks, given the largest eigenvalues of both and the norm of what
/// couples them.
double LargestOfBlocks(double translation, double rotation, double couple) {
  const double half = 0.5 * (translation - rotation);
  return 0.5 * (translation + rotation) + std::sqrt(half * half + couple * couple);
}

Symmetric TranslationOf(const OwnStiffness& k) {
  return {k.shared[0], k.shared[1], k.shared[2], k.shared_off[0], k.shared_off[1], k.shared_off[2]};
}

Symmetric RotationOf(const OwnStiffness& k) {
  return {k.shared_turn[0],     k.shared_turn[1],     k.shared_turn[2],
          k.shared_turn_off[0], k.shared_turn_off[1], k.shared_turn_off[2]};
}

std::array<double, 3> CoupleOf(const OwnStiffness& k) {
  return {k.shared[3], k.shared_off[3], k.shared_turn[3]};
}

Matrix Full(const Symmetric& s) {
  return {{{s[0], s[3], s[5]}, {s[3], s[1], s[4]}, {s[5], s[4], s[2]}}};
}

/// v x, as a matrix.
Matrix Cross(const std::array<double, 3>& v) {
  return {{{0, -v[2], v[1]}, {v[2], 0, -v[0]}, {-v[1], v[0], 0}}};
}

Matrix Product(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      for (std::size_t k = 0; k < 3; ++k) {
        c[i][j] += a[i][k] * b[k][j];
      }
    }
  }
  return c;
}

}  // namespace

double OwnRate(const OwnStiffness& k, double inverse_mass, double inverse_inertia) {
  const std::array<double, 3> c = CoupleOf(k);
  return LargestOfBlocks(
      LargestEigenvalueBound(TranslationOf(k)) * inverse_mass,
      LargestEigenvalueBound(RotationOf(k)) * inverse_inertia,
      std::sqrt((c[0] * c[0] + c[1] * c[1] + c[2] * c[2]) * inverse_mass * inverse_inertia));
}

// A contact at a + r n from the centre of mass moves by v - (a + r n) x w and has the stiffness k,
// of which k (n x) = c_s (n x). So with A, D and c of the sphere itself, and [a] for (a x), the
// couple is A [a] + [c], and rotation is held by [a]' A [a] + [a]' [c] + [c]' [a] + D.
double OwnRate(std::span<const MemberStiffness> members, double inverse_mass,
               double inverse_inertia) {
  Symmetric translation{};
  Symmetric rotation{};
  Matrix couple{};
  for (const MemberStiffness& m : members) {
    const Symmetric own = TranslationOf(*m.own);
    const Symmetric spin = RotationOf(*m.own);
    const Matrix arm = Cross(m.arm);
    const Matrix turned = Product(Full(own), arm);
    const Matrix c = Cross(CoupleOf(*m.own));
    Matrix held{};  // of which rotation gets both halves of the last two terms
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        couple[i][j] += turned[i][j] + c[i][j];
        for (std::size_t k = 0; k < 3; ++k) {
          held[i][j] += arm[k][i] * (turned[k][j] + c[k][j]) + c[k][i] * arm[k][j];
        }
      }
    }
    for (std::size_t a = 0; a < 3; ++a) {
      const std::size_t b = (a + 1) % 3;
      translation[a] += own[a];
      translation[a + 3] += own[a + 3];
      rotation[a] += spin[a] + held[a][a];
      rotation[a + 3] += spin[a + 3] + held[a][b];
    }
  }
  double squares = 0;
  for (const auto& row : couple) {
    for (const double c : row) {
      squares += c * c;
    }
  }
  return LargestOfBlocks(LargestEigenvalueBound(translation) * inverse_mass,
                         LargestEigenvalueBound(rotation) * inverse_inertia,
                         std::sqrt(squares * inverse_mass * inverse_inertia));
}

double StableStep(const FastestRates& rates, double local_damping) {
  const double larger = 1.0 + local_damping;
  const double least =
      rates.dashpot + std::sqrt(rates.dashpot * rates.dashpot + 4.0 * rates.spring / larger);
  return least > 0 ? 4.0 / larger / least : std::numeric_limits<double>::infinity();
}

}  // namespace calib::dem
