#pragma once
// Bodies of several materials: what each is made of, and what holds between two of them.

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dem/contact/contact_kernel.h"
#include "dem/contact/grain_mass.h"
#include "dem/model/contact_law.h"
#include "dem/model/model.h"

namespace calib::dem {

/// Stiffness of two bodies one behind the other, from those of contacts among equals: 2ab/(a + b),
/// exactly `a` where both are the same. a, b >= 0, in one unit. For the moduli of Hertz and Mindlin
/// this is
///   1/E* = (1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2,   1/G* = (2 - nu_1)/G_1 + (2 - nu_2)/G_2
/// [Johnson 1985, Eq. 4.24; Mindlin & Deresiewicz, J. Appl. Mech. 20 (1953) 327]
inline double InSeries(double a, double b) { return a == b ? a : 2.0 * (a / (a + b)) * b; }

/// What the materials of a model are made of, and what holds between two of them. Immutable;
/// thread-safe. Parameters of the model say what a material has: NAME.P with a parameter P of the
/// contact law or with density [kg/m^3]; what is left out is that of `grains`. A pair A-B has
/// InSeries() stiffnesses and dampings and the smaller friction of its two materials, unless A-B.P
/// gives it one of its own: friction_coefficient [-]; damping, where the law has it. Parameters of
/// effects hold for all pairs; those with ParameterInfo::of_pairs may have other values
/// for a pair, A-A too, as A-B.EFFECT.P.
class Materials {
 public:
  /// law: the contact law of the model; own: the parameters of the law for `grains`; thickness: of
  /// disks [m], 0: spheres. Precondition: MaterialProblems() finds nothing wrong with the model.
  Materials(const Model& model, const ContactInfo& law, const ParameterSet& own, double thickness);

  /// Number of materials, >= 1, `grains` among them.
  [[nodiscard]] int count() const { return static_cast<int>(laws_.size()); }
  /// Length of a table with one value per ordered pair of materials.
  [[nodiscard]] int pairs() const { return count() * count(); }

  /// Index of the material of this name; 0 for `grains` and for "". Precondition: the model has it.
  [[nodiscard]] int IndexOf(const std::string& name) const;

  /// Index of a pair in tables with one value per ordered pair. Values of (a, b) and (b, a) are
  /// equal.
  [[nodiscard]] int Pair(int a, int b) const { return a * count() + b; }

  /// Parameters of the contact law of a material.
  [[nodiscard]] const ParameterSet& law(int material) const {
    return laws_[static_cast<std::size_t>(material)];
  }
  [[nodiscard]] double density(int material) const {  ///< [kg/m^3]
    return densities_[static_cast<std::size_t>(material)];
  }
  [[nodiscard]] double friction(int pair) const {  ///< tan(phi_mu) [-]
    return friction_[static_cast<std::size_t>(pair)];
  }

  /// The parameter A-B.NAME or B-A.NAME of two materials in SI units, or nothing where the model
  /// does not give it.
  [[nodiscard]] std::optional<double> PairParameter(int a, int b, const std::string& name) const;

  /// Replaces those of `values`, one per Pair(), for whose pair the model gives a parameter of this
  /// name.
  void ApplyPairParameters(const std::string& name, std::vector<double>& values) const;

  /// Fills in what follows from block.materials and the radii: effective masses, and between grains
  /// friction, which changes in proportion where block.sliding_friction is not that of
  /// `grains` (consolidation); where that is 0, there is no proportion, and the pairs that rub keep
  /// theirs.
  void Complete(ContactBlock& block) const;

 private:
  std::vector<std::string> names_;
  std::vector<ParameterSet> laws_;
  std::vector<double> densities_;
  std::vector<double> friction_;    ///< per pair
  std::vector<double> mass_units_;  ///< per material: GrainMass::unit
  double depth_ = 0;                ///< GrainMass::depth
  std::map<std::string, double> parameters_;
};

/// One value per pair of materials, by Materials::Pair(): alone(law) for the parameters of the law
/// of one material gives its value among equals, mixed(a, b) the value between two from those of
/// each. For a model with one material one value, alone(context.law).
template <class Value, class Alone, class Mixed>
std::vector<Value> ForPairs(const KernelContext& context, const Alone& alone, const Mixed& mixed) {
  if (context.materials == nullptr) {
    return {alone(context.law)};
  }
  const Materials& materials = *context.materials;
  std::vector<Value> values;
  for (int a = 0; a < materials.count(); ++a) {
    for (int b = 0; b < materials.count(); ++b) {
      values.push_back(mixed(alone(materials.law(a)), alone(materials.law(b))));
    }
  }
  return values;
}

/// Values of a parameter of the effect context.effect in SI units, one per pair of materials, by
/// Materials::Pair(); for a model with one material one value.
std::vector<double> PairValues(const KernelContext& context, const std::string& parameter);

}  // namespace calib::dem
