#include "server/diagnosis/warm_fits.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/diagnosis/extension.h"
#include "server/diagnosis/warm_points.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

constexpr int kLeastSamples = 6;
constexpr int kShares = 15;      // batches that the campaign's number of samples pays for
constexpr double kCloser = 0.9;  // times the rms so far: the batch was worth it
constexpr int kMostIdle = 3;     // batches in a row that were not
// Of the mean history at the point that a fit is judged by, sd of the readings.
constexpr double kMostUnknown = 1;

// Samples of a batch.
int BatchOf(const FittedCampaign& base) {
  return std::max(kLeastSamples, static_cast<int>(base.runs().sample.size()) / kShares);
}

}  // namespace

std::vector<std::map<std::string, double>> PointsNear(const report::CampaignView& view,
                                                      const Eigen::MatrixXd& points,
                                                      const inference::FittedModel& model) {
  constexpr int kCount = 3;
  std::vector<std::map<std::string, double>> near;
  const auto rows = inference::PointsNotExcluded(model, kCount);
  if (!rows.ok()) return near;
  for (const Index row : *rows) near.push_back(PointOf(view, points, row));
  return near;
}

std::map<std::string, double> PointOf(const report::CampaignView& view,
                                      const Eigen::MatrixXd& points, Index row) {
  std::map<std::string, double> values;
  for (Index j = 0; j < points.cols(); ++j) {
    values[view.campaign.parameters[static_cast<std::size_t>(j)].name] = points(row, j);
  }
  return values;
}

std::int64_t WarmFits::Least() const {
  return static_cast<std::int64_t>(kLeastBatches) * BatchOf(base_) * base_.fitted_experiments();
}

absl::Status WarmFits::Fit(const RefitOrder& order, std::optional<std::int64_t> most) {
  if (order.first.empty()) return absl::OkStatus();
  const auto adequacy = inference::TestAdequacy(Base());
  const double base_chi2 = adequacy.ok() ? adequacy->chi2 : std::numeric_limits<double>::infinity();
  samples_ = BatchOf(base_);
  const int batch = samples_ * base_.fitted_experiments();
  int allowed = static_cast<int>(base_.runs().sample.size()) * base_.fitted_experiments();
  if (most) allowed = static_cast<int>(std::min<std::int64_t>(allowed, *most));
  const auto fitting = static_cast<std::size_t>(std::max(1, allowed / (kLeastBatches * batch)));
  std::vector<std::string> first = order.first;
  first.resize(std::min(first.size(), fitting));
  RETURN_IF_ERROR(Begin(first));
  while (spent_ + batch <= allowed) {
    const bool may_begin = spent_ + kLeastBatches * batch <= allowed;
    const auto next = NextRefit(order, Standings(), base_chi2, may_begin);
    if (!next) break;
    auto status = Find(*next) == nullptr ? Begin({*next}) : Continue(*next);
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

// Side by side.
absl::Status WarmFits::Begin(const std::vector<std::string>& effects) {
  for (const std::string& effect : effects) {
    ASSIGN_OR_RETURN(const auto text, FirstText(effect));
    RETURN_IF_ERROR(base_.Announce(text, effect));
  }
  for (int first = 0; first < kLeastBatches; ++first) {
    for (const std::string& effect : effects) {
      RETURN_IF_ERROR(Continue(effect));
    }
  }
  begun_.insert(begun_.end(), effects.begin(), effects.end());
  return absl::OkStatus();
}

std::vector<RefitStanding> WarmFits::Standings() const {
  std::vector<RefitStanding> standings;
  for (const std::string& effect : begun_) {
    const WarmFit& fit = fits_.at(effect);
    const bool has_runs = fit.model.histories.points() > 0;
    standings.push_back(
        {.effect = effect,
         .chi2 = has_runs ? fit.adequacy.chi2 : std::numeric_limits<double>::infinity(),
         .batches = static_cast<double>(fit.runs.histories.rows()) / samples_,
         .stalled = fit.stalled || fit.runs.histories.rows() == 0,
         .explains = fit.Explains(level_, begun_.size())});
  }
  return standings;
}

const WarmFit* WarmFits::Find(const std::string& effect) const {
  const auto found = fits_.find(effect);
  return found == fits_.end() ? nullptr : &found->second;
}

inference::FittedModel WarmFits::ByRuns(const report::RunTable& runs) const {
  return {.histories = runs.histories,
          .covariance = response_.of_run.covariance,
          .parameters = static_cast<int>(runs.parameters.cols()),
          .draws = response_.of_run.draws};
}

inference::FittedModel WarmFits::Base() const {
  return ByMean() ? response_.model : ByRuns(base_.runs());
}

absl::StatusOr<std::string> WarmFits::FirstText(const std::string& effect) const {
  return ExtensionText(base_.view(), {.effects = {effect},
                                      .purpose = "warm_fit",
                                      .held_out = false,
                                      .samples = samples_,
                                      .iterations = 1,
                                      .replicates = 0});  // it is judged by the scatter of the base
}

absl::Status WarmFits::Continue(const std::string& effect) {
  WarmFit& fit = fits_[effect];
  if (fit.stalled) return absl::OkStatus();
  spent_ += samples_ * base_.fitted_experiments();
  const std::string what = absl::StrCat("warm fit with ", effect, ", batch ", fit.iterations + 1);
  const double rms = fit.rms;
  const double chi2 = fit.adequacy.chi2;
  if (fit.iterations == 0) {
    ASSIGN_OR_RETURN(const auto text, FirstText(effect));
    auto view = base_.Run(text, what);
    if (absl::IsAborted(view.status())) {  // not one run of it came to an end
      fit.stalled = true;
      fit.iterations = 1;
      fit.rms = std::numeric_limits<double>::infinity();
      fit.chi2_after.push_back(std::numeric_limits<double>::infinity());
      return absl::OkStatus();
    }
    if (!view.ok()) return view.status();
    evaluations_ += view->status.model_evaluations();
    fit.view = *std::move(view);
    Add(fit.view, fit);
  } else {
    ASSIGN_OR_RETURN(const auto points, PointsFor(effect));
    campaign::Derivation derivation = base_.Derived("warm_fit_batch", what);
    for (Index i = 0; i < points.rows(); ++i) {
      derivation.rows.push_back({.like = fit.iterations * samples_ + static_cast<int>(i),
                                 .values = PointOf(fit.view, points, i)});
    }
    ASSIGN_OR_RETURN(const auto text,
                     campaign::Derive(fit.view.source.campaign_file(), derivation));
    ASSIGN_OR_RETURN(const auto view, base_.Run(text, what));
    evaluations_ += view.status.model_evaluations();
    Add(view, fit);
  }
  ++fit.iterations;
  if (fit.runs.histories.rows() == 0) {
    fit.rms = std::numeric_limits<double>::infinity();
    fit.chi2_after.push_back(std::numeric_limits<double>::infinity());
    return absl::OkStatus();
  }
  Judge(effect);
  fit.chi2_after.push_back(fit.adequacy.chi2);
  const bool closer = fit.rms < kCloser * rms || fit.adequacy.chi2 < kCloser * chi2;
  fit.idle = fit.iterations == 1 || closer ? 0 : fit.idle + 1;
  fit.stalled = fit.idle >= kMostIdle;
  return absl::OkStatus();
}

void WarmFits::Add(const report::CampaignView& batch, WarmFit& fit) const {
  Append(report::RunsOf(batch, base_.readings().of_mean), fit.runs);
  const Eigen::MatrixXd diverged = DivergedPoints(batch);
  const Index before = fit.diverged.rows();
  fit.diverged.conservativeResize(before + diverged.rows(), diverged.cols());
  fit.diverged.bottomRows(diverged.rows()) = diverged;
}

// Its own, those of the screen, and the base model's: at its null an effect changes nothing, and
// what a load cell does to a run can be calculated.
report::RunTable WarmFits::RunsFor(const std::string& effect) const {
  const WarmFit& fit = fits_.at(effect);
  const campaign::Campaign& campaign = fit.view.campaign;
  report::RunTable runs = fit.runs;
  Append(RunsOfScreen(screen_.RunsWith(effect), campaign), runs);
  const campaign::Campaign& parent = base_.view().campaign;
  auto misread = RunsMisread(base_.runs(), parent, base_.readings().of_mean, campaign);
  Append(misread ? *std::move(misread) : RunsWithoutEffect(base_.runs(), parent, campaign), runs);
  return runs;
}

absl::StatusOr<Eigen::MatrixXd> WarmFits::PointsFor(const std::string& effect) const {
  const WarmFit& fit = fits_.at(effect);
  return NextPoints(fit.view.campaign, base_.readings(), RunsFor(effect), fit.diverged,
                    fit.iterations, samples_);
}

void WarmFits::WeighEvidence() {
  for (auto& [effect, fit] : fits_) {
    if (fit.runs.histories.rows() == 0) continue;
    const report::RunTable runs = RunsFor(effect);
    std::optional<ScaledEvidence> evidence = ScaledEvidence{};
    for (std::size_t s = 0; evidence && s < kStrengthScales.size(); ++s) {
      const auto emulated =
          Emulate(WithStrengthScaled(fit.view.campaign, effect, kStrengthScales[s]),
                  base_.readings(), runs);
      if (!emulated.ok() || !emulated->adequate) {
        evidence.reset();
      } else {
        evidence->log_evidence[s] = emulated->log_evidence;
        evidence->standard_error = std::max(evidence->standard_error, emulated->log_evidence_se);
      }
    }
    fit.evidence = evidence;
  }
}

std::optional<double> WarmFits::BaseLogEvidence() const {
  const auto emulated = Emulate(base_.view().campaign, base_.readings(), base_.runs());
  if (!emulated.ok() || !emulated->adequate) return std::nullopt;
  return emulated->log_evidence;
}

void WarmFits::Judge(const std::string& effect) {
  WarmFit& fit = fits_.at(effect);
  fit.model = ByRuns(fit.runs);
  Eigen::MatrixXd points = fit.runs.parameters;
  if (ByMean()) {
    auto response = RespondTo(base_,
                              {.campaign = fit.view.campaign,
                               .runs = RunsFor(effect),
                               .draws = fit.runs.parameters,
                               .most_unknown = kMostUnknown},
                              response_.nuisance);
    if (!response.ok()) return;  // not known yet, or no more than before
    fit.model = std::move(response->model);
    points = std::move(response->points);
  }
  // By the base model's errors: covariances that were estimated apart differ by chance, which is
  // no merit of a model.
  const inference::FittedModel base = Base();
  const inference::FittedModel by_base = {.histories = fit.model.histories,
                                          .covariance = base.covariance,
                                          .parameters = fit.model.parameters};
  const auto adequacy = inference::TestAdequacy(fit.model);
  const auto advantage = inference::Compare(by_base, base);
  if (!adequacy.ok() || !advantage.ok()) return;
  fit.adequacy = *adequacy;
  fit.over_base = *advantage;
  if (ByMean()) {
    const auto p_value = inference::SignificanceOfGain(response_.model, fit.model);
    fit.gain_p_value = p_value.ok() ? *p_value : 1;
  }
  fit.best = PointOf(fit.view, points, adequacy->best);
  fit.near = PointsNear(fit.view, points, fit.model);
  fit.rms = std::numeric_limits<double>::infinity();
  for (Index point = 0; point < fit.model.histories.points(); ++point) {
    fit.rms = std::min(fit.rms, fit.model.histories.Rms(point));
  }
  if (const auto error = inference::LeftOutError(by_base, response_.parts); error.ok()) {
    fit.left_out_error = *error;
  }
}

}  // namespace calib::diagnosis
