#include "dem/registry/material_use.h"

#include <algorithm>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/contact/materials.h"
#include "dem/registry/catalog.h"

namespace calib::dem {
namespace {

std::string Known(const Model& model) {
  return model.materials.empty()
             ? absl::StrCat("the model has no materials besides ", kOwnMaterial)
             : absl::StrCat("there are ", absl::StrJoin(MaterialNames(model), ", "));
}

bool Has(const Model& model, const std::string& name) {
  const std::vector<std::string> names = MaterialNames(model);
  return std::find(names.begin(), names.end(), name) != names.end();
}

void CheckBodies(const Scenario& scenario, std::vector<std::string>& problems) {
  const std::vector<std::string> bodies = BodiesOf(scenario.test);
  for (const auto& [body, name] : scenario.materials.bodies) {
    if (std::find(bodies.begin(), bodies.end(), body) == bodies.end()) {
      problems.push_back(
          absl::StrCat("test ", scenario.test, " has no body \"", body, "\" to be of a material; ",
                       bodies.empty() ? "its grains may be"
                                      : absl::StrCat("it has ", absl::StrJoin(bodies, ", "))));
    }
    if (!Has(scenario.model, name)) {
      problems.push_back(
          absl::StrCat(body, " is of material \"", name, "\"; ", Known(scenario.model)));
    }
  }
}

void CheckShares(const Scenario& scenario, const TestInfo& test,
                 std::vector<std::string>& problems) {
  const auto& shares = scenario.materials.grains;
  double sum = 0;
  for (const auto& [name, share] : shares) {
    if (!Has(scenario.model, name) || name == kOwnMaterial) {
      problems.push_back(absl::StrCat("a share of the grains is of material \"", name, "\"; ",
                                      Known(scenario.model),
                                      ", and what is left over is of the first"));
    }
    if (!(share > 0 && share <= 1)) {
      problems.push_back(absl::StrCat("the share of ", name, " is ", share, ", allowed is (0, 1]"));
    }
    sum += share;
  }
  if (sum > 1 + 1e-12) {
    problems.push_back(absl::StrCat("shares of materials add up to ", sum, ", more than 1"));
  }
  if (!shares.empty() && (!test.needs_packing || test.fed_in)) {
    problems.push_back(
        absl::StrCat("test ", test.name, " has no mixture of grains: ",
                     test.needs_packing ? "they join while it runs" : "it has single bodies"));
  }
}

void CheckGrains(const Scenario& scenario, const TestInfo& test,
                 std::vector<std::string>& problems) {
  const Packing& packing = scenario.packing;
  std::set<std::string> unknown;
  for (const std::string& name : packing.material) {
    if (!name.empty() && !Has(scenario.model, name) && unknown.insert(name).second) {
      problems.push_back(absl::StrCat("grains of the packing are of material \"", name, "\"; ",
                                      Known(scenario.model)));
    }
  }
  if (!packing.material.empty() && packing.material.size() != packing.x.size()) {
    problems.emplace_back("the packing needs as many materials as grains, or none");
  }
  if (!packing.material.empty() && test.poured) {
    problems.push_back(absl::StrCat("test ", test.name,
                                    " takes the sizes of the packing's grains only, not their "
                                    "materials; give shares of the grains"));
  }
  if (!packing.material.empty() && !scenario.materials.grains.empty()) {
    problems.emplace_back(
        "the packing says which grains are of which material: shares of the grains are too much");
  }
  if (!scenario.model.materials.empty() && test.needs_packing &&
      std::any_of(packing.clump.begin(), packing.clump.end(), [](int id) { return id >= 0; })) {
    problems.emplace_back(
        "clumps are of one material: leave model.materials out, or use a packing of single "
        "spheres (clump -1)");
  }
}

}  // namespace

std::vector<std::string> BodiesOf(const std::string& test) {
  const TestInfo* info = FindTest(test);
  return info == nullptr ? std::vector<std::string>{} : info->bodies;
}

std::vector<std::string> MaterialUseProblems(const Scenario& scenario) {
  std::vector<std::string> problems;
  const TestInfo* test = FindTest(scenario.test);
  if (test == nullptr) {
    return problems;
  }
  CheckBodies(scenario, problems);
  CheckShares(scenario, *test, problems);
  CheckGrains(scenario, *test, problems);
  return problems;
}

}  // namespace calib::dem
