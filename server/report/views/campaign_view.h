#pragma once
// Everything that is known of one campaign, as reports, tables and exports read it. Nothing here
// asks the server.

#include <map>
#include <string>
#include <vector>

#include "calib/v1/campaign.pb.h"
#include "server/campaign/model/campaign.h"

namespace calib::report {

/// The states of one sample in one experiment.
struct StateHistory {
  std::vector<std::string> observables;  ///< what the values of each state are, in order
  std::vector<v1::State> states;
  double core_seconds = 0;  ///< spent on all attempts; 0: not known
};

struct CampaignView {
  campaign::Campaign campaign;
  v1::CampaignStatus status;
  v1::CampaignSource source;
  v1::Posterior posterior;  ///< the latest
  std::vector<v1::Posterior>
      iterations;  ///< the posterior after each iteration, the last being `posterior`
  std::vector<v1::Sample> samples;
  std::map<std::pair<std::string, int>, StateHistory> states;  ///< by (experiment, sample index)
};

}  // namespace calib::report
