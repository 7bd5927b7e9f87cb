#pragma once
// Grains that crush lose size: strengths of a Weibull distribution with size effect.

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "dem/dynamics/assembly.h"

namespace calib::dem {

/// A grain of diameter d crushes where its largest contact force F makes F/d^2 reach its strength
///   s = s0 ((d0/d)^3 ln(1/(1 - U)))^(1/m),  U uniform in (0, 1),
/// that is P(survival) = exp(-(d/d0)^3 (s/s0)^m).
/// [Jaeger 1967 for F/d^2; McDowell & Bolton 1998, Eqs. 2-6]
struct CrushingLaw {
  double weakness = 0;               ///< 1/s0 [1/Pa]; 0: nothing crushes
  double weibull_modulus = 3;        ///< m [-] > 0
  double reference_diameter = 1e-3;  ///< d0 [m] > 0
  double size_loss = 0;              ///< share of the diameter that a crushed grain loses, 0 .. 1

  /// Whether any grain can crush.
  [[nodiscard]] bool Acts() const { return weakness > 0 && size_loss > 0; }
};

/// Looks at the grains of one assembly from time to time. A grain that crushes keeps its centre and
/// velocities and loses size_loss of its diameter; a new strength is drawn for what is left. What
/// it loses are fines, which carry no force and lie in the pores: their volume stays in the solid
/// volume, so that mass is conserved. Down to a tenth of the first diameter; smaller grains do not
/// crush (comminution limit). Draws depend on seed, grain and how often it has crushed, not on
/// order or threads. Not thread-safe.
class Crushing {
 public:
  /// Precondition: the grains of the assembly are single spheres.
  Crushing(const CrushingLaw& law, std::uint64_t seed, const Assembly& assembly);

  /// Crushes every grain whose strength the last EvaluateForces has reached, each once; returns how
  /// many. The forces are those of before until the next evaluation.
  int Crush(Assembly& assembly);

  /// OK while the fines fit the pores between what is left of the grains. Beyond a random close
  /// packing of fines there, 0.64 of the pores, they would carry the load, which the law has grains
  /// do alone. [Scott & Kilgour, J. Phys. D 2 (1969) 863] Errors: OUT_OF_RANGE with the porosity.
  [[nodiscard]] absl::Status FinesFit(const Assembly& assembly) const;

  /// Volume of the fines: what has crumbled away from grains of the radii that the assembly has now
  /// [m^3].
  [[nodiscard]] double FinesVolume(const Assembly& assembly) const;

  /// Strength [Pa] of the grain with this id at a diameter [m] > 0 after it has crushed `times` >=
  /// 0 times.
  [[nodiscard]] double Strength(int id, int times, double diameter) const;

 private:
  /// Brings a grain's strength up to its radius, also where an assembly went back to a snapshot.
  void Refresh(std::size_t grain, const ParticleArrays& particles);

  CrushingLaw law_;
  std::uint64_t seed_;
  std::vector<double> first_radius_;  ///< per place in the arrays
  std::vector<double> radius_;        ///< for which the strength is
  std::vector<double> strength_;
};

}  // namespace calib::dem
