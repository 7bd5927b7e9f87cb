#pragma once
// Posterior, samples, states and fit as tables for spreadsheets and scripts; SI units, 17
// significant digits.

#include <string>

#include "server/report/views/campaign_view.h"
#include "server/report/views/predictions.h"

namespace calib::report {

/// index,iteration,status,weight,log_likelihood,<parameters>
std::string SamplesCsv(const CampaignView& view);
/// sample,experiment,load_step,<observables of all experiments>; empty fields where an experiment
/// has no such observable.
std::string StatesCsv(const CampaignView& view);
/// parameter,unit,mean,sd,cov,q05,q50,q95,at_bound
std::string PosteriorCsv(const v1::Posterior& posterior);
/// experiment,role,load_step,control,observable,measured,sd,
/// predicted_mean,predicted_q05,predicted_q95,segment (one line)
std::string FitCsv(const CampaignView& view, const std::vector<ExperimentPrediction>& predictions);

}  // namespace calib::report
