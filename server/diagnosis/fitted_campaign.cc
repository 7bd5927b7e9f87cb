#include "server/diagnosis/fitted_campaign.h"

#include <algorithm>
#include <numeric>
#include <optional>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/diagnosis/extension.h"
#include "server/diagnosis/left_out_packings.h"

namespace calib::diagnosis {

using Eigen::Index;

FittedCampaign::FittedCampaign(client::Laboratory& laboratory, const report::CampaignView& view)
    : laboratory_(laboratory),
      view_(view),
      readings_(report::ReadingsWithScatter(view)),
      runs_(report::RunsOf(view, readings_.of_mean)),
      closed_forms_without_(ClosedFormsWithout(view.campaign, readings_)),
      state_(ReferenceOf(view)) {}

int FittedCampaign::fitted_experiments() const {
  return static_cast<int>(
      std::count_if(view_.campaign.experiments.begin(), view_.campaign.experiments.end(),
                    [](const auto& e) { return e.role == campaign::Role::kCalibrate; }));
}

std::vector<Index> FittedCampaign::BestRuns(std::size_t count) const {
  std::vector<Index> order(runs_.sample.size());
  std::iota(order.begin(), order.end(), Index{0});
  std::stable_sort(order.begin(), order.end(), [this](Index a, Index b) {
    return runs_.histories.row(a).squaredNorm() < runs_.histories.row(b).squaredNorm();
  });
  order.resize(std::min(order.size(), count));
  return order;
}

campaign::Derivation::Row FittedCampaign::RowLike(Index run) const {
  campaign::Derivation::Row row{.like = runs_.sample[static_cast<std::size_t>(run)], .values = {}};
  for (std::size_t j = 0; j < view_.campaign.parameters.size(); ++j) {
    row.values[view_.campaign.parameters[j].name] = runs_.parameters(run, static_cast<Index>(j));
  }
  return row;
}

campaign::Derivation FittedCampaign::Derived(const std::string& purpose,
                                             const std::string& what) const {
  return {.name = absl::StrCat(view_.campaign.name, ": ", what),
          .lineage = {.parent = id(), .purpose = purpose},
          .effects = {},
          .parameters = {},
          .fixed = {},
          .held_out = false,
          .samples = std::nullopt,
          .max_iterations = std::nullopt,
          .first_proposal = std::nullopt,
          .rows = {}};
}

absl::Status FittedCampaign::Announce(const campaign::Derivation& derivation,
                                      const std::string& what) const {
  const auto text = campaign::Derive(view_.source.campaign_file(), derivation);
  return text.ok() ? Announce(*text, what) : text.status();
}

absl::Status FittedCampaign::Announce(const std::string& text, const std::string& what) const {
  return laboratory_.Submit(view_, text, what).status();
}

absl::StatusOr<report::CampaignView> FittedCampaign::Run(const campaign::Derivation& derivation,
                                                         const std::string& what) const {
  ASSIGN_OR_RETURN(const auto text, campaign::Derive(view_.source.campaign_file(), derivation));
  return Run(text, what);
}

absl::StatusOr<report::CampaignView> FittedCampaign::Run(const std::string& text,
                                                         const std::string& what) const {
  return laboratory_.Run(view_, text, what);
}

}  // namespace calib::diagnosis
