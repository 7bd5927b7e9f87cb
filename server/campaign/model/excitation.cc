#include "server/campaign/model/excitation.h"

#include <algorithm>
#include <cmath>
#include <variant>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/registry/catalog.h"
#include "dem/registry/declared_effects.h"

namespace calib::campaign {
namespace {

constexpr const char* kCollision = "collision";

// A body that hits another one of the same kind: there is no wall.
bool IsBetweenBodies(const Experiment& experiment) {
  if (experiment.test != kCollision) return false;
  const auto partner = experiment.settings.find("partner_radius");
  return partner != experiment.settings.end() && std::isfinite(partner->second);
}

// Centres that stay in a plane, as those of a silo between two plates one grain apart.
bool IsPlane(const Experiment& experiment) {
  const auto flat = experiment.settings.find("flat");
  return flat != experiment.settings.end() && flat->second >= 0.5;
}

bool IsCalibrated(const Campaign& campaign, const std::string& effect) {
  const auto of_effect = [prefix = effect + "."](const auto& parameter) {
    return absl::StartsWith(parameter.name, prefix);
  };
  return std::any_of(campaign.parameters.begin(), campaign.parameters.end(), of_effect) ||
         std::any_of(campaign.tied.begin(), campaign.tied.end(), of_effect);
}

}  // namespace

bool MakesItsBodies(const Experiment& experiment) {
  return !experiment.specimens.empty() &&
         std::holds_alternative<NoPacking>(experiment.specimens.front());
}

bool ReadAtRest(const Experiment& experiment) {
  const dem::TestInfo* const test = dem::FindTest(experiment.test);
  return test != nullptr && test->needs_packing && !test->poured && !experiment.loading_rate;
}

bool CanShow(const Experiment& experiment, const dem::EffectInfo& effect) {
  const auto& tests = effect.excited_by;
  if (!tests.empty() && std::find(tests.begin(), tests.end(), experiment.test) == tests.end()) {
    return false;
  }
  if (effect.kind == "boundary" && IsBetweenBodies(experiment)) return false;
  if (effect.needs_space && IsPlane(experiment)) return false;
  return !effect.needs_motion || !ReadAtRest(experiment);
}

std::string WhereItActs(const dem::EffectInfo& effect) {
  std::string where =
      absl::StrJoin(effect.excited_by, ", ", [&effect](std::string* out, const std::string& test) {
        const bool wall = effect.kind == "boundary" && test == kCollision;
        absl::StrAppend(out, test, wall ? " with a wall (no partner_radius)" : "");
      });
  if (effect.needs_motion) {
    absl::StrAppend(&where, where.empty() ? "" : ", ",
                    "tests with a loading_rate, collisions and flows under gravity; readings of "
                    "staged tests are taken at rest");
  }
  if (effect.needs_space) absl::StrAppend(&where, "; not in a plane (flat)");
  return where;
}

std::vector<std::string> EffectsWithoutPart(const Campaign& campaign) {
  std::vector<std::string> found;
  if (campaign.table || RunsRowsOnly(campaign) || campaign.lineage) return found;
  for (const std::string& name : campaign.model.effects) {
    const dem::EffectInfo* const effect = dem::FindEffect(campaign.model.user_effects, name);
    if (effect == nullptr) continue;
    const bool of_specimen = effect->kind == "particle" || effect->kind == "initial_state";
    if (!of_specimen && !IsCalibrated(campaign, name)) continue;
    if (std::none_of(campaign.experiments.begin(), campaign.experiments.end(),
                     [effect](const Experiment& e) { return CanShow(e, *effect); })) {
      found.push_back(absl::StrCat("effect ", name, " has no part in any of the experiments: ",
                                   "it acts in ", WhereItActs(*effect)));
    }
  }
  return found;
}

}  // namespace calib::campaign
