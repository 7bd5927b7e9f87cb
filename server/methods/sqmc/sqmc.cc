#include "server/methods/sqmc/sqmc.h"

#include "absl/strings/str_cat.h"
#include "server/campaign/file/shared/map_reader.h"
#include "server/methods/iterative_bayesian_filter/filter.h"
#include "server/methods/iterative_bayesian_filter/filter_planner.h"

namespace calib::methods {
namespace {

constexpr const char* kManyIterations = "iterative_bayesian_filter";

class Sqmc final : public Filter {
 public:
  std::string name() const override { return "sqmc"; }
  std::string extended_by() const override { return kManyIterations; }
  int standard_iterations() const override { return 1; }

  std::shared_ptr<const campaign::Method> Read(campaign::MapReader& inference,
                                               campaign::Campaign& campaign) const override {
    ReadFilterKeys(inference, campaign);
    if (inference.Has("max_iterations") && campaign.max_iterations != 1) {
      inference.Problem("max_iterations",
                        absl::StrCat("has to be 1 with sqmc, which has one iteration; use ",
                                     kManyIterations, " for more"));
    }
    campaign.max_iterations = 1;
    return std::make_shared<Sqmc>();
  }

  campaign::MethodInWords InWords(const campaign::Campaign& campaign,
                                  int /*iterations*/) const override {
    return {"Sequential quasi-Monte Carlo filter",
            {"Cheng H, Shuku T, Thoeni K, Yamamoto H (2018) Probabilistic calibration "
             "of discrete element simulations using the sequential quasi-Monte Carlo "
             "filter. Granular Matter 20:11"},
            absl::StrCat(", ", campaign.samples, " samples")};
  }

  std::unique_ptr<planning::Planner> MakePlanner(
      const planning::Definition& definition) const override {
    static const FilterPlan kOnce{.once = true};
    return MakeFilterPlanner(definition, kOnce);
  }
};

}  // namespace

std::shared_ptr<const campaign::Method> MakeSqmc() { return std::make_shared<Sqmc>(); }

}  // namespace calib::methods
