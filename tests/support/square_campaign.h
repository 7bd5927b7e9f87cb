#pragma once
// The smallest campaign that can be emulated: two parameters in the unit square and two readings.

#include "server/campaign/model/campaign.h"

namespace calib::testing {

/// Parameters a and b, uniform from 0 to 1; q_over_p measured as 1 with an sd of 0.1, twice, in a
/// drained triaxial test.
inline campaign::Campaign SquareCampaign() {
  campaign::Experiment experiment;
  experiment.name = "tx";
  experiment.test = "triaxial_drained";
  experiment.settings["confining_pressure"] = 1e5;
  experiment.control_name = "axial_strain";
  experiment.control = {0.01, 0.02};
  experiment.path = {{.target = 0.01, .load_step = 0}, {.target = 0.02, .load_step = 1}};
  experiment.segment = {"initial_loading", "initial_loading"};
  experiment.observables.push_back({.name = "q_over_p", .values = {1, 1}, .sd = {0.1, 0.1}});
  campaign::Campaign campaign;
  campaign.experiments.push_back(experiment);
  for (const char* name : {"a", "b"}) {
    campaign.parameters.push_back(
        {.name = name,
         .unit = "1",
         .prior = {.kind = inference::PriorKind::kUniform, .min = 0, .max = 1}});
  }
  return campaign;
}

}  // namespace calib::testing
