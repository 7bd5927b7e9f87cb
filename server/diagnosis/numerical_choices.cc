#include "server/diagnosis/numerical_choices.h"

#include "dem/model/staging.h"
#include "server/campaign/model/excitation.h"

namespace calib::diagnosis {
namespace {

constexpr double kMostDamping = 0.9;

}  // namespace

std::vector<campaign::Derivation> NumericalChanges(const FittedCampaign& base) {
  const campaign::Campaign& campaign = base.view().campaign;
  const Eigen::Index best = base.BestRuns(1).front();
  const campaign::Derivation::Row row = base.RowLike(best);
  std::vector<campaign::Derivation> changes;
  for (const char* what : {"twice the rate", "half the step", "other damping"}) {
    changes.push_back(base.Derived("nuisance", what));
    changes.back().rows = {row};
  }
  bool staged = false;
  for (const campaign::Experiment& e : campaign.experiments) {
    if (e.role != campaign::Role::kCalibrate || !campaign::ReadAtRest(e)) continue;
    staged = true;
    dem::Scenario scenario;
    scenario.model = campaign.model;
    scenario.settings = e.settings;
    scenario.initial_stress = e.initial_stress;
    scenario.staging = e.staging;
    const dem::Staging used = dem::ResolveStaging(scenario, base.state().diameter);
    const double damping = *used.damping_loading;
    changes[0].staging[e.name].rate = 2 * *used.rate;
    changes[1].staging[e.name].step = *used.step / 2;
    dem::Staging& damped = changes[2].staging[e.name];
    damped.damping_loading = damping > kMostDamping / 2 ? damping / 2 : 2 * damping;
    damped.damping_settling = used.damping_settling;
  }
  if (!staged) changes.clear();
  return changes;
}

}  // namespace calib::diagnosis
