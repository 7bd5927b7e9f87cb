#pragma once
// A real campaign that is small enough for a test: a drained triaxial test on 64 grains, a fraction
// of a second a run.

#include <map>
#include <string>

namespace calib::testing {

struct SmallCampaign {
  std::string yaml{};
  std::map<std::string, std::string> files{};  ///< path -> content
};

struct SmallCampaignOptions {
  int samples = 8;  ///< 0: neither samples nor max_iterations are stated
  int max_iterations = 2;
  int load_steps = 4;
  int failure_attempts = 5;
  double relative_noise = 0.1;
  int packings = 1;              ///< realizations, each a packing file of its own
  bool with_validation = false;  ///< a second experiment at another pressure, held out
  bool with_second = false;      ///< the same, calibrated
  std::string method = "iterative_bayesian_filter";
  std::string inference{};  ///< further lines under inference, each "  key: value\n"
  std::string extra{};      ///< further top-level YAML
};

SmallCampaign MakeSmallCampaign(const SmallCampaignOptions& options);

/// The same experiments as a design. parameters, inference: further lines of these sections, each
/// "  key: value\n".
SmallCampaign MakeSmallDesign(const SmallCampaignOptions& options, const std::string& parameters,
                              const std::string& inference);

}  // namespace calib::testing
