#include "server/diagnosis/left_out_error.h"

#include <algorithm>

#include "server/diagnosis/fitted_campaign.h"
#include "server/diagnosis/response.h"

namespace calib::diagnosis {
namespace {

std::optional<double> ErrorOf(const Response& response, const Eigen::MatrixXd& covariance) {
  const auto error = inference::LeftOutError({.histories = response.model.histories,
                                              .covariance = covariance,
                                              .parameters = response.model.parameters},
                                             response.parts);
  return error.ok() ? std::optional<double>(*error) : std::nullopt;
}

}  // namespace

std::optional<double> LeftOutErrorOf(client::Laboratory& laboratory,
                                     const report::CampaignView& view,
                                     const std::vector<Eigen::VectorXd>& nuisance) {
  const FittedCampaign base(laboratory, view);
  const auto response = RespondTo(base, nuisance);
  if (!response.ok() || !response->trustworthy) return std::nullopt;
  return ErrorOf(*response, response->model.covariance);
}

std::optional<LeftOutErrors> LeftOutErrorsOf(client::Laboratory& laboratory,
                                             const report::CampaignView& without,
                                             const report::CampaignView& with,
                                             const std::vector<Eigen::VectorXd>& nuisance) {
  const FittedCampaign base(laboratory, without);
  const auto before = RespondTo(base, nuisance);
  const auto after = RespondTo(base, with, nuisance);
  if (!before.ok() || !after.ok() || !before->trustworthy || !after->trustworthy) {
    return std::nullopt;
  }
  const auto own = ErrorOf(*before, before->model.covariance);
  const auto extended = ErrorOf(*after, before->model.covariance);
  if (!own || !extended) return std::nullopt;
  return LeftOutErrors{.without = *own, .with = *extended};
}

bool WorseLeftOut(const std::optional<double>& without, const std::optional<double>& with) {
  return without && with && *with > std::max(1.0, *without);
}

}  // namespace calib::diagnosis
