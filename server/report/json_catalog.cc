// Contacts, effects and lab tests of this build as JSON.
#include <cmath>
#include <nlohmann/json.hpp>

#include "dem/catalog/catalog.h"
#include "server/report/json_documents.h"

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
                    {"parameters", Parameters(e->parameters)},
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
    list.push_back({{"name", t.name},
                    {"description", t.description},
                    {"parameters", Parameters(t.settings)},
                    {"meshes", meshes},
                    {"observables", t.observables},
                    {"control", t.control},
                    {"may_reverse", t.may_reverse},
                    {"reference", t.reference}});
  }
  return list.dump(2) + "\n";
}

}  // namespace calib::report
