#include "server/campaign/checks/noise_check.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "inference/data/reading_noise.h"

namespace calib::campaign {
namespace {

using Eigen::Index;
using inference::ReadingRun;

Eigen::MatrixXd CovarianceOf(const Experiment& experiment, const MeasuredObservable& observable) {
  if (observable.covariance.size() > 0) return observable.covariance;
  const auto n = static_cast<Index>(observable.sd.size());
  const Eigen::Map<const Eigen::VectorXd> sd(observable.sd.data(), n);
  Eigen::MatrixXd covariance = sd.cwiseAbs2().asDiagonal();
  const double length = observable.correlation_length;
  if (!(length > 0)) return covariance;
  const std::vector<double> at = TravelledControl(experiment, length);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      const double apart =
          std::abs(at[static_cast<std::size_t>(i)] - at[static_cast<std::size_t>(j)]);
      covariance(i, j) = sd[i] * sd[j] * std::exp(-apart / length);
    }
  }
  return covariance;
}

bool IsInOrder(const std::vector<double>& control, std::size_t from, std::size_t to) {
  const auto begin = control.begin() + static_cast<std::ptrdiff_t>(from);
  const auto end = control.begin() + static_cast<std::ptrdiff_t>(to);
  return std::is_sorted(begin, end) || std::is_sorted(begin, end, std::greater<>());
}

// The loading stages, each a smooth curve; readings in any other order are none.
std::vector<ReadingRun> RunsOf(const Experiment& experiment, const MeasuredObservable& observable) {
  std::vector<ReadingRun> runs;
  const std::size_t n = observable.values.size();
  if (n == 0 || observable.sd.size() != n || experiment.segment.size() != n ||
      experiment.control.size() != n) {
    return runs;
  }
  const Eigen::MatrixXd covariance = CovarianceOf(experiment, observable);
  const Eigen::Map<const Eigen::VectorXd> values(observable.values.data(), static_cast<Index>(n));
  for (std::size_t from = 0; from < n;) {
    std::size_t to = from + 1;
    while (to < n && experiment.segment[to] == experiment.segment[from]) ++to;
    std::vector<Index> rows;
    for (std::size_t i = from; i < to; ++i) {
      if (!std::isnan(observable.values[i])) rows.push_back(static_cast<Index>(i));
    }
    if (IsInOrder(experiment.control, from, to) && !rows.empty()) {
      runs.push_back({.values = values(rows), .covariance = covariance(rows, rows)});
    }
    from = to;
  }
  return runs;
}

/// Stated correlation of the errors of neighbours from which on a curve that scatters less says
/// nothing against them [-]. Chosen: differences then hold less than half of the variance.
constexpr double kTogether = 0.5;

// Whether the errors are stated to go together from one reading to the next: what they have in
// common leaves no trace in differences of neighbours, however large it is.
bool AreStatedTogether(const std::vector<ReadingRun>& runs) {
  double sum = 0;
  Index count = 0;
  for (const ReadingRun& run : runs) {
    for (Index i = 1; i < run.covariance.rows(); ++i, ++count) {
      sum +=
          run.covariance(i, i - 1) / std::sqrt(run.covariance(i, i) * run.covariance(i - 1, i - 1));
    }
  }
  return count > 0 && sum > kTogether * static_cast<double>(count);
}

// What the curves say against the noise stated; empty: nothing.
std::optional<inference::ReadingNoise> Doubt(const std::vector<ReadingRun>& runs) {
  const auto noise = inference::CompareReadingNoise(runs);
  if (!noise.ok()) return std::nullopt;
  if (noise->surely_larger || (noise->surely_smaller && !AreStatedTogether(runs))) return *noise;
  return std::nullopt;
}

Warning ScatterWarning(const std::string& experiment, const std::string& observable,
                       const inference::ReadingNoise& noise) {
  const std::string found = absl::StrFormat(
      "the readings %sscatter from one to the next by %.2g times the stated noise (%d differences "
      "of neighbours)",
      experiment.empty() ? "of all fitted experiments " : "",
      noise.surely_larger ? noise.robust : noise.scale, noise.differences);
  const char* const meaning =
      noise.surely_larger ? ": it is stated too small, so that no model can fit them; state it "
                            "larger, or noise: inferred"
                          : ": it is stated too large, or its errors go together over many "
                            "readings (correlation_length); an effect can hide in it";
  return {WarningKind::kScatter, experiment, observable, absl::StrCat(found, meaning)};
}

}  // namespace

std::vector<Warning> NoiseWarnings(const Campaign& campaign) {
  std::vector<Warning> warnings;
  if (campaign.filter.noise != inference::NoiseMode::kGiven) return warnings;
  std::map<std::string, std::vector<ReadingRun>> together;  // of all that calibrate
  std::map<std::string, int> experiments;
  std::vector<std::string> said;
  for (const Experiment& experiment : campaign.experiments) {
    for (const MeasuredObservable& observable : experiment.observables) {
      const std::vector<ReadingRun> runs = RunsOf(experiment, observable);
      if (experiment.role == Role::kCalibrate) {
        auto& all = together[observable.name];
        all.insert(all.end(), runs.begin(), runs.end());
        ++experiments[observable.name];
      }
      const auto noise = Doubt(runs);
      if (!noise) continue;
      warnings.push_back(ScatterWarning(experiment.name, observable.name, *noise));
      said.push_back(observable.name);
    }
  }
  for (const auto& [name, runs] : together) {
    if (experiments[name] < 2 || std::find(said.begin(), said.end(), name) != said.end()) continue;
    const auto noise = Doubt(runs);
    if (!noise) continue;
    warnings.push_back(ScatterWarning("", name, *noise));
  }
  return warnings;
}

}  // namespace calib::campaign
