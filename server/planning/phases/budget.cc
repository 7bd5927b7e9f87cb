#include "server/planning/phases/budget.h"

#include <algorithm>
#include <limits>

namespace calib::planning {
namespace {

constexpr double kMostEvaluations = 1e15;

/// Evaluations of one sample.
std::int64_t Calibrated(const Step& step) {
  return static_cast<std::int64_t>(
      step.definition.ExperimentsOf(campaign::Role::kCalibrate).size());
}

/// Core seconds of one evaluation, those stopped early and repeated among them, in the mean over
/// what has been asked for so far; 0 while nothing has.
double SecondsOfOne(const Step& step) {
  const std::int64_t asked =
      static_cast<std::int64_t>(step.history.samples.size()) * Calibrated(step) - step.history.open;
  return asked > 0 ? step.history.effort.core_seconds / static_cast<double>(asked) : 0;
}

}  // namespace

bool BudgetSpent(const Step& step) {
  const bool one_by_one = step.campaign().method->chooses_while_running();
  return Exceeds(step, (one_by_one ? 1 : step.campaign().method->LaterBatch(step.campaign())) *
                           Calibrated(step));
}

std::int64_t Affordable(const Step& step) {
  const campaign::Budget& budget = step.campaign().budget;
  const History& history = step.history;
  if (Exceeds(step, Calibrated(step))) {
    return 0;
  }
  std::int64_t evaluations = std::numeric_limits<std::int64_t>::max();
  if (budget.model_evaluations.has_value()) {
    evaluations = *budget.model_evaluations - history.effort.model_evaluations - history.open;
  }
  if (const double seconds = SecondsOfOne(step); budget.core_hours && seconds > 0) {
    const double left = *budget.core_hours * 3600 - history.effort.core_seconds;
    evaluations = std::min(
        evaluations,
        static_cast<std::int64_t>(std::min(left / seconds, kMostEvaluations)) - history.open);
  }
  return evaluations / Calibrated(step);
}

bool Exceeds(const Step& step, std::int64_t next) {
  const campaign::Budget& budget = step.campaign().budget;
  const History& history = step.history;
  return (budget.model_evaluations.has_value() &&
          history.effort.model_evaluations + history.open + next > *budget.model_evaluations) ||
         (budget.core_hours.has_value() &&
          history.effort.core_seconds +
                  SecondsOfOne(step) * static_cast<double>(history.open + next) >
              *budget.core_hours * 3600);
}

}  // namespace calib::planning
