// Contacts, effects and lab tests of this build as JSON.
#include <cmath>
#include <nlohmann/json.hpp>

#include "dem/registry/catalog.h"
#include "dem/registry/declared_effects.h"
#include "server/report/documents/json_documents.h"

namespace calib::report {
namespace {

using Json = nlohmann::ordered_json;

Json Parameter(const dem::ParameterInfo& p) {
  Json json = {
      {"name", p.name},
      {"unit", p.unit},
      {"min", p.min},
      {"max", p.max},
      {"default_prior", p.default_prior.kind.empty() ? Json(nullptr)
                                                     : Json({{"prior", p.default_prior.kind},
                                                             {"min", p.default_prior.min},
                                                             {"max", p.default_prior.max}})},
      {"default_value", p.default_value ? Json(*p.default_value) : Json(nullptr)},
      {"null_value", p.null_value ? Json(*p.null_value) : Json(nullptr)},
      {"description", p.description}};
  if (!p.null_by_contact.empty()) json["null_by_contact"] = p.null_by_contact;
  if (!p.unit_by_contact.empty()) json["unit_by_contact"] = p.unit_by_contact;
  if (!p.alternative_to.empty()) json["alternative_to"] = p.alternative_to;
  return json;
}

Json Scale(const dem::ReferenceScale& scale) {
  return {{"factor", scale.factor},
          {"pressure", scale.pressure},
          {"diameter", scale.diameter},
          {"modulus", scale.modulus}};
}

// Of an effect: what makes its strength comparable, too.
Json EffectParameter(const dem::ParameterInfo& p) {
  Json json = Parameter(p);
  json["of_pairs"] = p.of_pairs;
  json["reference_scale"] = Scale(p.scale);
  if (!p.scale_by_contact.empty()) {
    Json& by_contact = json["reference_scale_by_contact"] = Json::object();
    for (const auto& [contact, scale] : p.scale_by_contact) by_contact[contact] = Scale(scale);
  }
  json["scaled_default_prior"] = p.scaled_prior ? Json({{"prior", p.scaled_prior->kind},
                                                        {"min", p.scaled_prior->min},
                                                        {"max", p.scaled_prior->max}})
                                                : Json(nullptr);
  return json;
}

Json EffectParameters(const std::vector<dem::ParameterInfo>& parameters) {
  Json list = Json::array();
  for (const dem::ParameterInfo& p : parameters) list.push_back(EffectParameter(p));
  return list;
}

Json ObservableDetails(const std::vector<std::string>& names) {
  Json list = Json::array();
  for (const std::string& name : names) {
    const dem::ObservableInfo& info = *dem::FindObservable(name);
    list.push_back({{"name", info.name}, {"unit", info.unit}, {"description", info.description}});
  }
  return list;
}

Json Parameters(const std::vector<dem::ParameterInfo>& parameters) {
  Json list = Json::array();
  for (const dem::ParameterInfo& p : parameters) list.push_back(Parameter(p));
  return list;
}

}  // namespace

std::string ContactsJson() {
  Json list = Json::array();
  for (const dem::ContactInfo& c : dem::Contacts()) {
    list.push_back({{"name", c.name},
                    {"description", c.description},
                    {"parameters", Parameters(c.parameters)},
                    {"reference", c.reference}});
  }
  return list.dump(2) + "\n";
}

std::string EffectsJson(std::span<const dem::UserEffect> declared) {
  Json list = Json::array();
  for (const dem::EffectInfo* e : dem::AllEffects(declared)) {
    list.push_back({{"name", e->name},
                    {"kind", e->kind},
                    {"description", e->description},
                    {"contacts", e->contacts},
                    {"two_sided", e->two_sided},
                    {"excited_by", e->excited_by},
                    {"needs_motion", e->needs_motion},
                    {"needs_space", e->needs_space},
                    {"across_pressures", e->across_pressures},
                    {"excludes", e->excludes},
                    {"family", e->family.empty() ? Json(nullptr) : Json(e->family)},
                    {"parameters", EffectParameters(e->parameters)},
                    {"reference", e->reference}});
  }
  return list.dump(2) + "\n";
}

std::string TestsJson() {
  Json list = Json::array();
  for (const dem::TestInfo& t : dem::Tests()) {
    Json meshes = Json::array();
    for (const dem::MeshInfo& m : t.meshes) {
      meshes.push_back({{"name", m.name}, {"description", m.description}});
    }
    std::vector<std::string> other_controls = t.other_controls;
    if (!t.stress_control.empty()) other_controls.push_back(t.stress_control);
    list.push_back({{"name", t.name},
                    {"description", t.description},
                    {"parameters", Parameters(t.settings)},
                    {"meshes", meshes},
                    {"observables", t.observables},
                    {"observable_details", ObservableDetails(t.observables)},
                    {"control", t.control},
                    {"other_controls", other_controls},
                    {"may_reverse", t.may_reverse},
                    {"reference", t.reference}});
  }
  return list.dump(2) + "\n";
}

}  // namespace calib::report
