#include "server/methods/tmcmc/tmcmc.h"

#include "absl/strings/str_cat.h"
#include "inference/tmcmc/tmcmc.h"
#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/model/campaign.h"
#include "server/methods/tmcmc/tmcmc_planner.h"

namespace calib::methods {
namespace {

class Tmcmc final : public campaign::Method {
 public:
  std::string name() const override { return "tmcmc"; }
  bool keeps_batches() const override { return true; }
  bool needs_errors() const override { return true; }
  int fewest_samples(std::size_t /*parameters*/) const override { return 20; }  // chains
  int standard_iterations() const override { return 100; }                      // stages

  int MostBatches(const campaign::Campaign& campaign) const override {
    return 1 +
           campaign.max_iterations * inference::StepsPerStage(options_, campaign.parameters.size());
  }

  std::vector<campaign::Section> Keys() const override {
    const inference::TmcmcOptions standard;
    return {{"inference",
             "inference",
             {
                 {"steps", campaign::Whole(1, 1000), "three a parameter, at least 10",
                  "tmcmc: Metropolis steps per stage"},
                 {"target_cv", campaign::Number("1", {.min = 0, .max = 2, .min_open = true}),
                  absl::StrCat(standard.target_cv), "tmcmc: variation of a stage's weights"},
             }}};
  }

  std::shared_ptr<const campaign::Method> Read(campaign::MapReader& inference,
                                               campaign::Campaign& /*campaign*/) const override {
    auto read = std::make_shared<Tmcmc>();
    inference::TmcmcOptions& options = read->options_;
    options.steps = static_cast<int>(inference.Integer("steps").value_or(options.steps));
    options.target_cv = inference.Quantity("target_cv").value_or(options.target_cv);
    return read;
  }

  std::string ScatterLeftOut(const campaign::Campaign& /*campaign*/,
                             const std::string& what) const override {
    return absl::StrCat(name(), " compares runs by the stated errors alone: ", what,
                        " is not in them, a lucky run holds its chain, and the intervals are too "
                        "narrow. iterative_bayesian_filter takes it in.");
  }

  campaign::MethodInWords InWords(const campaign::Campaign& campaign,
                                  int /*iterations*/) const override {
    return {"Transitional Markov chain Monte Carlo",
            {"Ching J, Chen YC (2007) Transitional Markov chain Monte Carlo method for "
             "Bayesian model updating, model class selection, and model averaging. "
             "J Eng Mech 133:816–832",
             "Hadjidoukas PE, Angelikopoulos P, Rossinelli D, Alexeev D, Papadimitriou "
             "C, Koumoutsakos P (2014) Bayesian uncertainty quantification and "
             "propagation for discrete element simulations of granular materials. "
             "Comput Methods Appl Mech Eng 282:218–238"},
            absl::StrCat(", ", campaign.samples, " chains")};
  }

  std::unique_ptr<planning::Planner> MakePlanner(
      const planning::Definition& definition) const override {
    return MakeTmcmcPlanner(definition, options_);
  }

 private:
  inference::TmcmcOptions options_;  // steps and target_cv
};

}  // namespace

std::shared_ptr<const campaign::Method> MakeTmcmc() { return std::make_shared<Tmcmc>(); }

}  // namespace calib::methods
