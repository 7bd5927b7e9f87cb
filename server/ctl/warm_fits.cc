#include "server/ctl/warm_fits.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "server/ctl/extension.h"

namespace calib::ctl {
namespace {

using Eigen::Index;

constexpr int kLeastSamples = 10;
constexpr int kShares = 9;           // iterations that the campaign's number of samples pays for
constexpr int kLeastIterations = 2;  // of each: the first one is blind
constexpr double kPatience = 1.2;    // an iteration more must bring a fit this much closer

}  // namespace

std::map<std::string, double> PointOf(const report::CampaignView& view,
                                      const Eigen::MatrixXd& points, Index row) {
  std::map<std::string, double> values;
  for (Index j = 0; j < points.cols(); ++j) {
    values[view.campaign.parameters[static_cast<std::size_t>(j)].name] = points(row, j);
  }
  return values;
}

absl::Status WarmFits::Fit(const std::vector<std::string>& effects) {
  const auto runs = static_cast<int>(base_.runs().sample.size());
  samples_ = std::max(kLeastSamples, runs / kShares);
  int spent = 0;
  for (const std::string& effect : effects) {  // side by side
    const auto text = TextOf(effect, kLeastIterations);
    if (!text.ok()) return text.status();
    if (auto status = base_.Announce(*text, effect); !status.ok()) return status;
  }
  for (const std::string& effect : effects) {
    if (auto status = FitOne(effect, kLeastIterations); !status.ok()) return status;
    spent += kLeastIterations * samples_;
  }
  while (spent + samples_ <= runs) {
    const std::string* next = nullptr;
    double lowest = 0;
    for (const std::string& effect : effects) {
      const WarmFit& fit = fits_.at(effect);
      if (fit.model) continue;
      const double price = fit.best_run * std::pow(kPatience, fit.iterations);
      if (next == nullptr || price < lowest) {
        next = &effect;
        lowest = price;
      }
    }
    if (next == nullptr) break;
    if (auto s = FitOne(*next, fits_.at(*next).iterations + 1); !s.ok()) return s;
    spent += samples_;
  }
  return absl::OkStatus();
}

const WarmFit* WarmFits::Find(const std::string& effect) const {
  const auto found = fits_.find(effect);
  return found == fits_.end() ? nullptr : &found->second;
}

std::int64_t WarmFits::evaluations() const {
  std::int64_t sum = 0;
  for (const auto& [effect, fit] : fits_) sum += fit.view.status.model_evaluations();
  return sum;
}

// The same but for the number of iterations: what has been run is not run again.
absl::StatusOr<std::string> WarmFits::TextOf(const std::string& effect, int iterations) const {
  return ExtensionText(base_.view(), {.effects = {effect},
                                      .purpose = "warm_fit",
                                      .held_out = false,
                                      .samples = samples_,
                                      .iterations = iterations});
}

absl::Status WarmFits::FitOne(const std::string& effect, int iterations) {
  const auto text = TextOf(effect, iterations);
  if (!text.ok()) return text.status();
  auto view = base_.Run(*text, absl::StrCat("warm fit with ", effect));
  if (!view.ok()) return view.status();
  WarmFit fit{.view = *std::move(view), .iterations = iterations};
  const report::RunTable runs = report::RunsOf(fit.view);
  if (runs.histories.rows() > 0) {
    Index best = 0;
    fit.best_run = std::sqrt(runs.histories.rowwise().squaredNorm().minCoeff(&best) /
                             static_cast<double>(runs.histories.cols()));
    fit.rms = fit.best_run;
    fit.best = PointOf(fit.view, runs.parameters, best);
    Judge(fit);
  } else {
    fit.best_run = fit.rms = std::numeric_limits<double>::infinity();
  }
  fits_.insert_or_assign(effect, std::move(fit));
  return absl::OkStatus();
}

void WarmFits::Judge(WarmFit& fit) const {
  const auto response =
      RespondTo(fit.view, nuisance_,
                RunsWithoutEffect(base_.runs(), base_.view().campaign, fit.view.campaign));
  if (!response.ok() || !response->trustworthy) return;
  const auto adequacy = inference::TestAdequacy(response->model);
  const auto advantage = inference::Compare(response->model, base_model_);
  if (!adequacy.ok() || !advantage.ok()) return;
  fit.adequacy = *adequacy;
  fit.over_base = *advantage;
  fit.best = PointOf(fit.view, response->points, adequacy->best);
  fit.rms = response->model.histories.row(adequacy->best).norm() /
            std::sqrt(static_cast<double>(response->model.histories.cols()));
  fit.model = response->model;
}

}  // namespace calib::ctl
