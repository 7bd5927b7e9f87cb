#pragma once
// What was done to come to an answer, for whoever repeats or publishes it.

#include <string>
#include <vector>

#include "server/report/views/campaign_view.h"

namespace calib::report {

/// What was done in sentences of a paper, and what they cite. Pure.
struct Methods {
  std::vector<std::string> sentences{};  ///< "[1]" is the first of the references
  std::vector<std::string> references{};
};
Methods MethodsOf(const CampaignView& view);

/// The posterior as a LaTeX table (package booktabs), in people's units. Pure.
std::string LatexTable(const CampaignView& view);

/// JSON: `campaign`, `entries` (pairs of a term and what it is), `files` (`path, sha256`),
/// `campaign_file`, `iterations` (`iteration, ess, pareto_k, log_evidence, log_evidence_se,
/// model_evaluations, parameters` by name: `mean, q05, q95`), `methods` (`sentences, references`),
/// `latex`. Pure.
std::string RecordJson(const CampaignView& view);

}  // namespace calib::report
