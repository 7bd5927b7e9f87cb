#include "server/planning/requests.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "calib/return_if_error.h"
#include "server/messages/attempt_spec.h"
#include "server/planning/decisions.h"
#include "server/planning/rungs.h"

namespace calib::planning {

using campaign::Role;
using store::EvaluationStatus;

namespace {

constexpr double kHeldOutMass = 0.99;

}  // namespace

absl::Status Requests::Calibrate(const store::SampleRecord& sample, bool refused) {
  if (definition_.campaign.precomputed.has_value()) {
    TakeFromTables(sample);
    return absl::OkStatus();
  }
  if (!refused) {
    const std::size_t first = plan_.evaluations.size();
    // Where runs may rest or stop, what has ended decides what goes on: a run that is there to its
    // end already, of another campaign, would change the answer.
    const bool may_stop =
        RestsAtRungs(definition_) || DecidesAtOnce(definition_) || !std::isnan(sample.stop_below);
    absl::Status status = Request(sample, definition_.ExperimentsOf(Role::kCalibrate), !may_stop);
    for (std::size_t i = first; i < plan_.evaluations.size(); ++i) {
      plan_.evaluations[i].rest_after = FirstRung(definition_, plan_.evaluations[i].key.experiment);
    }
    return status;
  }
  for (const int experiment : definition_.ExperimentsOf(Role::kCalibrate)) {
    plan_.evaluations.push_back({.key = {id_, sample.sample, experiment},
                                 .status = EvaluationStatus::kStoppedEarly,
                                 .reason = "outside the prior: rejected without a run",
                                 .reused = true});  // no effort of this campaign
  }
  return absl::OkStatus();
}

absl::Status Requests::Run(const store::SampleRecord& sample, const std::vector<int>& experiments) {
  return Request(sample, experiments, /*reuse=*/true);
}

absl::Status Requests::Request(const store::SampleRecord& sample,
                               const std::vector<int>& experiments, bool reuse) {
  for (const int experiment : experiments) {
    store::EvaluationRecord evaluation{
        .key = {id_, sample.sample, experiment},
        .digest = messages::RunDigest(messages::LeaseOf(definition_.campaign, experiment,
                                                        ToRun(definition_.campaign, sample)))};
    if (reuse) {
      ASSIGN_OR_RETURN(const auto equal, reader_.FindEqual(evaluation.digest));
      if (equal.has_value()) {
        plan_.reused.emplace_back(*equal, evaluation.key);
      }
    }
    plan_.evaluations.push_back(std::move(evaluation));
  }
  return absl::OkStatus();
}

void Requests::TakeFromTables(const store::SampleRecord& sample) {
  for (std::size_t e = 0; e < definition_.campaign.experiments.size(); ++e) {
    const std::size_t width = definition_.campaign.experiments[e].observables.size();
    const auto& values =
        definition_.campaign.precomputed->values[e][static_cast<std::size_t>(sample.sample)];
    const bool finite =
        std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
    const store::EvaluationKey key{id_, sample.sample, static_cast<int>(e)};
    plan_.evaluations.push_back(
        {.key = key,
         .status = finite ? EvaluationStatus::kFinished : EvaluationStatus::kDiverged,
         .reason = finite ? "" : "the table holds a value that is not finite",
         .reused = true});
    for (std::size_t r = 0; finite && (r + 1) * width <= values.size(); ++r) {
      const auto at = values.begin() + static_cast<std::ptrdiff_t>(r * width);
      plan_.states.push_back({.key = key,
                              .load_step = static_cast<int>(r),
                              .observables = {at, at + static_cast<std::ptrdiff_t>(width)}});
    }
  }
}

std::vector<std::size_t> Heaviest(const std::vector<double>& log_weights) {
  std::vector<std::size_t> order(log_weights.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&log_weights](std::size_t a, std::size_t b) {
    return log_weights[a] > log_weights[b];
  });
  std::size_t count = 0;
  double mass = 0;
  while (count < std::min(order.size(), kHeldOutRuns) && mass < kHeldOutMass) {
    mass += std::exp(log_weights[order[count++]]);
  }
  order.resize(count);
  return order;
}

std::vector<std::size_t> EvenlyByWeight(const std::vector<double>& log_weights) {
  std::vector<std::size_t> positions;
  double mass = 0;
  double next = 0.5;
  for (std::size_t i = 0; i < log_weights.size(); ++i) {
    mass += std::exp(log_weights[i]) * static_cast<double>(kHeldOutRuns);
    if (mass <= next) continue;
    next = std::floor(mass - 0.5) + 1.5;
    positions.push_back(i);
  }
  return positions;
}

Eigen::MatrixXd EvenlySpaced(const Eigen::MatrixXd& draws, std::size_t most) {
  const auto count = static_cast<Eigen::Index>(
      std::min({kHeldOutRuns, most, static_cast<std::size_t>(draws.rows())}));
  Eigen::MatrixXd rows(count, draws.cols());
  for (Eigen::Index i = 0; i < count; ++i) rows.row(i) = draws.row(i * draws.rows() / count);
  return rows;
}

}  // namespace calib::planning
