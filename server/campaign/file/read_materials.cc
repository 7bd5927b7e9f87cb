#include "server/campaign/file/read_materials.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "dem/model/model.h"
#include "dem/registry/material_use.h"
#include "dem/registry/model_parameters.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/model/range.h"

namespace calib::campaign {
namespace {

bool Has(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// A material, or a pair in either order.
bool SameOwner(const std::string& one, const std::string& other) {
  const std::size_t dash = one.find('-');
  return one == other || (dash != std::string::npos &&
                          absl::StrCat(one.substr(dash + 1), "-", one.substr(0, dash)) == other);
}

// The values that stand under a material or a pair.
void ReadValues(MapReader& section, const std::string& owner, dem::Model& model) {
  auto values = section.Map(owner);
  if (!values) return;
  for (const std::string& key : values->Keys()) {
    const std::string name = absl::StrCat(owner, ".", key);
    const dem::ParameterInfo* info = dem::FindParameter(model, name);
    if (info == nullptr) {
      values->Ignore({key});
      if (model.contact.empty()) continue;
      std::vector<std::string> offered;
      for (const std::string& known : dem::MaterialParameters(model)) {
        const std::size_t dot = known.find('.');
        if (SameOwner(known.substr(0, dot), owner)) offered.push_back(known.substr(dot + 1));
      }
      values->Problem(
          key, absl::StrCat("is nothing that ", owner, " may have; ",
                            offered.empty() ? "among equals it has values of effects only, and the "
                                              "model has no effect of pairs"
                                            : Suggestion(key, offered)));
      continue;
    }
    const auto value =
        values->Quantity(key, dem::UnitFor(*info, model.contact), AdmissibleRange(*info));
    model.parameters[name] = value.value_or(std::nan(""));
  }
  values->Finish();
}

}  // namespace

void ReadMaterials(MapReader& model_map, dem::Model& model) {
  auto materials = model_map.Map("materials");
  auto pairs = model_map.Map("pairs");
  if (materials) {
    for (const std::string& name : materials->Keys()) {
      if (!dem::IsMaterialName(name)) {  // a dot in it would make another name of its parameters
        materials->Ignore({name});
        materials->Problem(name, "is no name of a material: letters, digits and _ only");
      } else if (!Has(model.materials, name)) {
        model.materials.push_back(name);
      }
    }
    for (const std::string& name : model.materials) ReadValues(*materials, name, model);
    materials->Finish();
  }
  const std::vector<std::string> names = dem::MaterialNames(model);
  if (pairs) {
    for (const std::string& key : pairs->Keys()) {
      if (dem::IsMaterialPair(model, key)) {
        ReadValues(*pairs, key, model);
        continue;
      }
      pairs->Ignore({key});
      pairs->Problem(key,
                     absl::StrCat("is no pair A-B of two materials; there are ", Listed(names)));
    }
    pairs->Finish();
  }
  for (const std::string& problem : dem::MaterialProblems(model)) {
    model_map.Problem("materials", problem);
  }
}

dem::MaterialUse ReadMaterialUse(MapReader& experiment_map, const dem::TestInfo& test,
                                 const dem::Model& model) {
  dem::MaterialUse use;
  auto map = experiment_map.Map("materials");
  if (!map) return use;
  if (test.needs_packing) {
    if (auto shares = map->Map("grains")) {
      for (const std::string& name : shares->Keys()) {
        const auto share = shares->Quantity(name);
        if (!Has(model.materials, name)) {
          shares->Problem(name, absl::StrCat("is no material of model.materials; ",
                                             Suggestion(name, model.materials)));
        } else if (share) {
          use.grains[name] = *share;
        }
      }
      shares->Finish();
    }
  }
  for (const std::string& body : dem::BodiesOf(test.name)) {
    if (!map->Has(body)) continue;
    const auto name = map->Choice(body, dem::MaterialNames(model));
    if (name) use.bodies[body] = *name;
  }
  map->Finish();
  return use;
}

void CheckMaterialsUsed(const MapReader& campaign_map, const Campaign& campaign) {
  if (campaign.table || campaign.lineage) return;
  for (const std::string& name : campaign.model.materials) {
    const auto uses = [&name](const Experiment& experiment) {
      const auto of_body = [&name](const auto& body) { return body.second == name; };
      const auto of_grains = [&name](const Specimen& specimen) {
        const auto* file = std::get_if<PackingFile>(&specimen);
        return file != nullptr && Has(file->packing.material, name);
      };
      return experiment.materials.grains.contains(name) ||
             std::any_of(experiment.materials.bodies.begin(), experiment.materials.bodies.end(),
                         of_body) ||
             std::any_of(experiment.specimens.begin(), experiment.specimens.end(), of_grains);
    };
    if (std::none_of(campaign.experiments.begin(), campaign.experiments.end(), uses)) {
      campaign_map.Problem(
          "model", absl::StrCat("material ", name, " has no part in any of the experiments: give ",
                                "it to their grains or bodies under materials"));
    }
  }
}

}  // namespace calib::campaign
