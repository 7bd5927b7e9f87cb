#pragma once
// One scalar parameter of a contact law, an effect or a lab test: unit, admissible range, default
// prior, and the scale at which an effect's parameter begins to matter.

#include <map>
#include <optional>
#include <string>

namespace calib::dem {

/// Prior offered when a user asks for none in particular. kind: "uniform" | "log_uniform"; bounds
/// in SI.
struct DefaultPrior {
  std::string kind;
  double min = 0;
  double max = 0;
};

/// State by which strengths of effects become comparable between grain sizes and stresses. One for
/// a whole campaign, since some effects have parameters that must not differ between experiments.
struct ReferenceState {
  double pressure = 0;  ///< p, at which the test starts [Pa] > 0
  double diameter = 0;  ///< d, mean of the grains [m] > 0
  double modulus = 0;   ///< E, young_modulus [Pa] > 0
};

/// Value at which a parameter begins to matter: factor p^pressure d^diameter E^modulus. Powers of
/// zero: the parameter is dimensionless already.
struct ReferenceScale {
  double factor = 1;
  double pressure = 0;
  double diameter = 0;
  double modulus = 0;
};

/// One scalar parameter of a contact, an effect or a lab test (there called a setting).
struct ParameterInfo {
  std::string name;  ///< "young_modulus"; of an effect: without the prefix ("stiffness", not
                     ///< "rolling_resistance.stiffness")
  std::string unit;  ///< SI: "Pa", "rad", "N m/rad", "1" (dimensionless)
  std::map<std::string, std::string>
      unit_by_contact;    ///< where the unit depends on the contact law; else empty
  double min = 0;         ///< smallest admissible value [unit]
  double max = 0;         ///< largest admissible value [unit]; may be infinite
  bool min_open = false;  ///< min itself is not admissible
  bool whole = false;     ///< only whole numbers are admissible
  DefaultPrior default_prior;
  std::optional<double>
      default_value;           ///< used when neither calibrated nor fixed; empty: must be given
  std::string alternative_to;  ///< gives the same quantity as this other parameter (friction_angle
                               ///< <-> friction_coefficient)
  std::string description;

  // What follows is set for parameters of effects only.
  std::optional<double> null_value;  ///< the effect vanishes when this parameter alone has this
                                     ///< value; empty: it shapes the effect but cannot remove it
  std::map<std::string, double> null_by_contact;  ///< where the null depends on the contact law
  ReferenceScale scale;                           ///< value at which it begins to matter: ScaleOf()
  std::map<std::string, ReferenceScale> scale_by_contact;  ///< where the scale depends on the law
  std::optional<DefaultPrior> scaled_prior;  ///< of value / scale, 0.01 .. 10 and wider; PriorOf()
  bool of_pairs = false;  ///< pairs of materials may have values of their own, A-B.EFFECT.NAME
};

/// SI unit of a parameter under a contact law (a name of Contacts()).
const std::string& UnitFor(const ParameterInfo& parameter, const std::string& contact);

/// Reference scale of an effect's parameter under a contact law, in the parameter's SI unit.
double ScaleOf(const ParameterInfo& parameter, const std::string& contact,
               const ReferenceState& state);

/// Value at which the parameter switches its effect off under a contact law [the parameter's SI
/// unit]; empty when it cannot.
std::optional<double> NullValueOf(const ParameterInfo& parameter, const std::string& contact);

/// Prior to offer for a parameter, in SI: scaled_prior times ScaleOf() where there is one,
/// otherwise default_prior, cut to [min, max].
DefaultPrior PriorOf(const ParameterInfo& parameter, const std::string& contact,
                     const ReferenceState& state);

}  // namespace calib::dem
