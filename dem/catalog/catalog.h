#pragma once
// What this build offers: contacts, effects, lab tests and observables, each with parameters, SI
// units, admissible ranges, default priors and reference. The one table that campaign validation,
// `calibctl effects|tests|contacts`, reports and the engine read; adding an entry here and its
// .h/.cc pair is all that a new one needs.

#include <array>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace calib::dem {

/// Prior offered when a user asks for none in particular. kind: "uniform" | "log_uniform"; bounds
/// in SI.
struct DefaultPrior {
  std::string kind;
  double min = 0;
  double max = 0;
};

/// What makes strengths of effects comparable between grain sizes and stresses; one for a whole
/// campaign, since some effects have parameters that must not differ between experiments.
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

  // Of an effect's parameters only.
  std::optional<double> null_value;  ///< the effect vanishes when this parameter alone has this
                                     ///< value; empty: it shapes the effect but cannot remove it
  std::map<std::string, double> null_by_contact;  ///< where the null depends on the contact law
  ReferenceScale scale;                           ///< see ScaleOf()
  std::map<std::string, ReferenceScale> scale_by_contact;  ///< where it depends on the contact law
  std::optional<DefaultPrior> scaled_prior;  ///< of value / scale, 0.01 .. 10 and wider; PriorOf()
  bool of_pairs = false;  ///< pairs of materials may have values of their own, A-B.EFFECT.NAME
};

struct ContactInfo {
  std::string name;
  std::string description;
  std::vector<ParameterInfo> parameters;
  std::string reference;
};

/// One way to turn an effect up from nothing: a parameter leaves its null while others are held.
struct StrengthRay {
  std::string parameter;                 ///< undotted; has a null value
  std::array<double, 2> steps = {0, 0};  ///< two moderate distances from the null, none of them 0,
                                         ///< the nearer first, in units of the parameter's scale:
                                         ///< > 0 in the catalogue, of either sign in a user's
                                         ///< effect; of a two-sided effect -steps are as good where
                                         ///< they are admissible
  std::map<std::string, double> held = {};  ///< other parameters / scale; not listed: their default
  /// What it changes grows with this power of the distance from the null, about; > 0.
  double order = 1;
};

struct EffectInfo {
  std::string name;
  std::string kind;  ///< "contact" | "particle" | "initial_state" | "boundary" | "measurement"
  std::string
      description;  ///< formula, sign (one- or two-sided) and the value at which it vanishes
  std::vector<std::string> contacts;  ///< contact laws it can join; empty: all
  std::vector<ParameterInfo> parameters;
  std::string reference;
  bool two_sided = false;              ///< parameters of the rays may leave their null either way
  std::vector<StrengthRay> rays = {};  ///< 1 .. 3, for paired runs with and without the effect
  std::vector<std::string> excited_by = {};  ///< tests whose curves it can change; empty: all
  /// Shows only where pressure differs: between tests at one pressure each, or in any other.
  bool across_pressures = false;
  bool needs_motion = false;  ///< shows only where grains move while they are read: not in staged
                              ///< tests, whose readings are taken at rest
  bool needs_space = false;   ///< shows only where grains move in three dimensions: not in a plane
                              ///< silo
  std::vector<std::string> excludes = {};  ///< other laws of the same thing: never both
};

struct ObservableInfo {
  std::string name;
  std::string unit;
  std::string description;
};

/// Values that a control may take.
struct ControlRange {
  double min = 0;
  double max = 0;
  bool whole = false;  ///< only whole numbers are admissible
};

/// A piece of a test's boundary that a mesh of the user's may replace.
struct MeshInfo {
  std::string name;
  std::string description;  ///< what it replaces, its origin and axes
};

struct TestInfo {
  std::string name;
  std::string description;               ///< geometry, control, stages, what makes it fail
  std::vector<ParameterInfo> settings;   ///< e.g. confining_pressure
  std::vector<std::string> observables;  ///< names, in the order in which a state holds its values
  std::string control;  ///< the observable that drives the loading ("axial_strain")
  std::vector<std::string> other_controls = {};  ///< settings that may drive it instead; the one
                                                 ///< that does is not given as a setting
  bool needs_packing = true;  ///< false: bodies come from the settings, nothing is consolidated
  bool may_reverse = true;    ///< the control may go down again (unload-reload)
  std::string reference;
  bool poured = false;  ///< takes only the sizes of the packing's grains, which it pours itself; no
                        ///< consolidation, no staging
  bool separate_points = false;  ///< every value of the control is a run of its own, in any order
  bool one_pressure = false;     ///< a stress is held at confining_pressure throughout (of
                                 ///< simple_shear unless constant_volume)
  std::optional<ControlRange> control_range = {};  ///< empty: strains below 1, stresses above 0
  std::vector<MeshInfo> meshes = {};
};

std::span<const ContactInfo> Contacts();
std::span<const EffectInfo> Effects();
std::span<const TestInfo> Tests();
std::span<const ObservableInfo> Observables();

/// Entry by name, or nullptr.
const ContactInfo* FindContact(const std::string& name);
const EffectInfo* FindEffect(const std::string& name);
/// One of them says that it excludes the other.
bool Exclude(const EffectInfo& a, const EffectInfo& b);
const TestInfo* FindTest(const std::string& name);
const ObservableInfo* FindObservable(const std::string& name);

/// Unit of a parameter under a contact law.
const std::string& UnitFor(const ParameterInfo& parameter, const std::string& contact);

/// Reference scale of an effect's parameter under a contact law, in the parameter's SI unit.
double ScaleOf(const ParameterInfo& parameter, const std::string& contact,
               const ReferenceState& state);

/// Null value under a contact law; empty when the parameter has none.
std::optional<double> NullValueOf(const ParameterInfo& parameter, const std::string& contact);

/// scaled_prior times ScaleOf() where there is one, default_prior otherwise, cut to [min, max]; SI.
DefaultPrior PriorOf(const ParameterInfo& parameter, const std::string& contact,
                     const ReferenceState& state);

/// Dotted parameters and their SI values that turn `effect` on at a distance `step` (in units of
/// scale) from the null of a ray; step 0: the model without the effect, bit for bit. Add the
/// effect's name to Model::effects and these to Model::parameters. Parameters at their default are
/// left out. The value may leave [min, max] for steps other than the ray's own: see
/// RayAdmits().
std::map<std::string, double> ParametersOnRay(const EffectInfo& effect, const StrengthRay& ray,
                                              double step, const std::string& contact,
                                              const ReferenceState& state);

/// Whether the ray's parameter is in its admissible range at that step.
bool RayAdmits(const EffectInfo& effect, const StrengthRay& ray, double step,
               const std::string& contact, const ReferenceState& state);

/// Parameter by its dotted campaign name ("friction_angle", "rolling_resistance.stiffness") for a
/// contact and a set of effects, or nullptr when that model has no such parameter.
const ParameterInfo* FindParameter(const std::string& contact, std::span<const std::string> effects,
                                   const std::string& dotted_name);

/// Everything above as text, in a fixed order: equal texts mean equal catalogues (server and worker
/// compare a digest).
std::string CatalogText();

/// Version of the mechanics: changes whenever the same scenario may give other bits.
std::string EngineVersion();

}  // namespace calib::dem
