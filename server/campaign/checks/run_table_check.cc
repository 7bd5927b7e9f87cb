#include "server/campaign/checks/run_table_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "absl/strings/str_cat.h"

namespace calib::campaign {
namespace {

/// Range of an observable over all runs, in sd of its reading, below which it counts as unmoved
/// [-]. Chosen: the posterior then differs from the prior by less than a hundredth of a sd per
/// reading.
constexpr double kMoved = 0.1;
/// The same over its size, where no error is stated [-]. Chosen: digits that codes print.
constexpr double kMovedOfSize = 1e-6;

void AddRepeated(const Campaign& campaign, std::vector<Warning>& warnings) {
  const Eigen::MatrixXd& rows = campaign.precomputed->parameters;
  std::set<std::vector<double>> different;
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const Eigen::VectorXd row = rows.row(i);
    different.emplace(row.begin(), row.end());
  }
  const Eigen::Index repeats = rows.rows() - static_cast<Eigen::Index>(different.size());
  if (repeats == 0) return;
  warnings.push_back(
      {WarningKind::kRepeated, "", "",
       absl::StrCat(repeats, " of the ", rows.rows(),
                    " runs made elsewhere repeat the parameters of another one. Each counts as a "
                    "draw of its own: the intervals are narrower and the effective samples more "
                    "than the ",
                    different.size(), " different sets tell.")});
}

// Whether some reading of the observable differs between runs by what could be measured.
bool AnyIsMoved(const std::vector<std::vector<double>>& states, std::size_t width, std::size_t j,
                const MeasuredObservable& observable) {
  for (const Eigen::Index row : RowsRead(observable)) {
    const auto i = static_cast<std::size_t>(row);
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (const std::vector<double>& state : states) {
      const double value = state[i * width + j];
      if (!std::isfinite(value)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
    const double sd = i < observable.sd.size() ? observable.sd[i] : std::nan("");
    if (IsMoved(low, high, sd)) return true;
  }
  return false;
}

}  // namespace

bool IsMoved(double low, double high, double sd) {
  const double least =
      std::isfinite(sd) ? kMoved * sd : kMovedOfSize * std::max(std::abs(low), std::abs(high));
  return high - low > least;
}

Warning UnmovedWarning(const Experiment& experiment, const MeasuredObservable& observable,
                       int runs) {
  return {WarningKind::kUnmoved, experiment.name, observable.name,
          absl::StrCat("is the same in all ", runs,
                       " runs to within a tenth of its error: its readings say nothing of the "
                       "parameters")};
}

std::vector<Warning> RunTableWarnings(const Campaign& campaign) {
  std::vector<Warning> warnings;
  if (!campaign.precomputed) return warnings;
  AddRepeated(campaign, warnings);
  for (std::size_t e = 0; e < campaign.precomputed->values.size(); ++e) {
    const Experiment& experiment = campaign.experiments[e];
    const auto& states = campaign.precomputed->values[e];
    const std::size_t width = experiment.observables.size();
    for (std::size_t j = 0; j < width; ++j) {
      const MeasuredObservable& observable = experiment.observables[j];
      if (states.size() < 2 || AnyIsMoved(states, width, j, observable)) continue;
      warnings.push_back(UnmovedWarning(experiment, observable, static_cast<int>(states.size())));
    }
  }
  return warnings;
}

}  // namespace calib::campaign
