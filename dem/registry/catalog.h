#pragma once
// What this build offers, by name: contact laws, effects, lab tests and observables, each with
// parameters, SI units, admissible ranges, default priors and reference. The one table that
// campaign validation, `calibctl effects|tests|contacts`, reports and the engine read. Thread-safe;
// what the functions return lives as long as the program.

#include <span>
#include <string>

#include "dem/model/contact_law.h"
#include "dem/model/effect.h"
#include "dem/model/engine_version.h"
#include "dem/model/lab_test.h"
#include "dem/model/observable.h"
#include "dem/model/parameter.h"

namespace calib::dem {

/// All entries, in the order in which they are listed.
std::span<const ContactInfo> Contacts();
std::span<const EffectInfo> Effects();
std::span<const TestInfo> Tests();
std::span<const ObservableInfo> Observables();

/// The entry of this name, or nullptr.
const ContactInfo* FindContact(const std::string& name);
const EffectInfo* FindEffect(const std::string& name);
const TestInfo* FindTest(const std::string& name);
const ObservableInfo* FindObservable(const std::string& name);

/// The parameter of this dotted campaign name ("friction_angle", "rolling_resistance.stiffness")
/// for a contact and a set of effects, or nullptr when that model has no such parameter.
const ParameterInfo* FindParameter(const std::string& contact, std::span<const std::string> effects,
                                   const std::string& dotted_name);

/// The whole catalogue as text, in a fixed order: equal texts mean equal catalogues (server and
/// worker compare a digest).
std::string CatalogText();

}  // namespace calib::dem
