#include "server/methods/iterative_bayesian_filter/iterative_bayesian_filter.h"

#include <algorithm>
#include <set>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "server/campaign/file/shared/map_reader.h"
#include "server/methods/iterative_bayesian_filter/filter.h"
#include "server/methods/iterative_bayesian_filter/filter_planner.h"

namespace calib::methods {
namespace {

constexpr const char* kFreeze = "freeze";

class IterativeBayesianFilter final : public Filter {
 public:
  std::string name() const override { return "iterative_bayesian_filter"; }
  bool takes_rows() const override { return true; }
  bool holds_parameters() const override { return !plan_.freeze.empty(); }

  std::vector<campaign::Section> Keys() const override {
    std::vector<campaign::Section> sections = Filter::Keys();
    sections.front().keys.push_back(
        {kFreeze, campaign::MapOf(kFreeze), "nothing", "iterative filter: what iterations hold"});
    sections.front().keys.push_back(
        {"rows", campaign::ListOf(campaign::MapOf("row")), "none",
         "table, design: runs to be made; iterative filter, adaptive_emulator: runs that come "
         "first, beside its own"});
    sections.push_back({kFreeze,
                        "inference.freeze",
                        {{"ITERATION", campaign::OneOrMore(campaign::Text()), "",
                          "parameters held from this iteration on; `converged`: those whose mean "
                          "the iteration before left alone"}}});
    return sections;
  }

  std::shared_ptr<const campaign::Method> Read(campaign::MapReader& inference,
                                               campaign::Campaign& campaign) const override {
    auto read = std::make_shared<IterativeBayesianFilter>();
    ReadFilterKeys(inference, campaign);
    if (inference.Has(kFreeze) && campaign.precomputed) {
      inference.Ignore({kFreeze});
      inference.Problem(kFreeze, "is for runs still to be made; these exist already");
    } else if (auto map = inference.Map(kFreeze)) {
      ReadFreeze(*map, campaign.max_iterations, read->plan_);
    }
    return read;
  }

  void Check(const campaign::MapReader& inference,
             const campaign::Campaign& campaign) const override {
    if (holds_parameters() && !campaign.populations.empty()) {
      inference.Problem(kFreeze,
                        absl::StrCat("does not go with parameters per experiment or batch (",
                                     campaign.populations.front().name,
                                     "), whose parts are not independent of each other"));
      return;
    }
    std::set<std::string> held;
    for (const auto& [iteration, freeze] : plan_.freeze) {
      for (const std::string& name : freeze.names) {
        const auto is_it = [&name](const campaign::CalibratedParameter& p) {
          return p.name == name;
        };
        if (std::none_of(campaign.parameters.begin(), campaign.parameters.end(), is_it)) {
          inference.Problem(kFreeze, absl::StrCat("'", name,
                                                  "' is not calibrated here; write names "
                                                  "of parameters, or converged alone"));
        }
        held.insert(name);
      }
    }
    if (!held.empty() && held.size() >= campaign.parameters.size()) {
      inference.Problem(kFreeze, "holds every parameter; leave at least one to be inferred");
    }
  }

  campaign::MethodInWords InWords(const campaign::Campaign& campaign,
                                  int iterations) const override {
    return {"Iterative Bayesian filter",
            {"Cheng H, Shuku T, Thoeni K, Tempone P, Luding S, Magnanimo V (2019) An "
             "iterative Bayesian filtering framework for fast and automated "
             "calibration of DEM models. Comput Methods Appl Mech Eng 350:268–294"},
            absl::StrCat(", ", iterations, " iterations of ", campaign.samples, " samples")};
  }

  std::unique_ptr<planning::Planner> MakePlanner(
      const planning::Definition& definition) const override {
    return MakeFilterPlanner(definition, plan_);
  }

 private:
  // freeze: {2: [young_modulus], 3: converged}; the names are looked at once the parameters are
  // known.
  static void ReadFreeze(campaign::MapReader& map, int max_iterations, FilterPlan& plan) {
    for (const std::string& key : map.Keys()) {
      int iteration = 0;
      if (!absl::SimpleAtoi(key, &iteration) || iteration < 1 || iteration >= max_iterations) {
        map.Ignore({key});
        map.Problem(key, absl::StrCat("is no iteration after the first; allowed: 1 to ",
                                      max_iterations - 1, " (the first is 0)"));
        continue;
      }
      const auto names = map.TextList(key);
      if (!names) continue;
      Freeze& freeze = plan.freeze[iteration];
      freeze.converged = *names == std::vector<std::string>{"converged"};
      if (!freeze.converged) freeze.names = *names;
    }
    map.Finish();
  }

  FilterPlan plan_;
};

}  // namespace

std::shared_ptr<const campaign::Method> MakeIterativeBayesianFilter() {
  return std::make_shared<IterativeBayesianFilter>();
}

}  // namespace calib::methods
