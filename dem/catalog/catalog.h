#pragma once
// What this build offers: contacts, effects, lab tests and observables, each with parameters, SI
// units, admissible ranges, default priors and reference. The one table that campaign validation,
// `calibctl effects|tests|contacts`, reports and the engine read; adding an entry here and its
// .h/.cc pair is all that a new one needs.

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
  DefaultPrior default_prior;
  std::optional<double>
      default_value;           ///< used when neither calibrated nor fixed; empty: must be given
  std::string alternative_to;  ///< gives the same quantity as this other parameter (friction_angle
                               ///< <-> friction_coefficient)
  std::string description;
};

struct ContactInfo {
  std::string name;
  std::string description;
  std::vector<ParameterInfo> parameters;
  std::string reference;
};

struct EffectInfo {
  std::string name;
  std::string kind;  ///< "contact" | "particle" | "initial_state" | "boundary" | "measurement"
  std::string
      description;  ///< formula, sign (one- or two-sided) and the value at which it vanishes
  std::vector<std::string> contacts;  ///< contact laws it can join; empty: all
  std::vector<ParameterInfo> parameters;
  std::string reference;
};

struct ObservableInfo {
  std::string name;
  std::string unit;
  std::string description;
};

struct TestInfo {
  std::string name;
  std::string description;               ///< geometry, control, stages, what makes it fail
  std::vector<ParameterInfo> settings;   ///< e.g. confining_pressure
  std::vector<std::string> observables;  ///< names, in the order in which a state holds its values
  std::string control;      ///< the observable that drives the loading ("axial_strain")
  bool may_reverse = true;  ///< the control may go down again (unload-reload)
  std::string reference;
};

std::span<const ContactInfo> Contacts();
std::span<const EffectInfo> Effects();
std::span<const TestInfo> Tests();
std::span<const ObservableInfo> Observables();

/// Entry by name, or nullptr.
const ContactInfo* FindContact(const std::string& name);
const EffectInfo* FindEffect(const std::string& name);
const TestInfo* FindTest(const std::string& name);
const ObservableInfo* FindObservable(const std::string& name);

/// Unit of a parameter under a contact law.
const std::string& UnitFor(const ParameterInfo& parameter, const std::string& contact);

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
