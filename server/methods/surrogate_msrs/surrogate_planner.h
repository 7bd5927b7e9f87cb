#pragma once
// surrogate_msrs: a symmetric Latin hypercube, behind points of the first proposal where there is
// one, then points chosen one by one on a response surface of the misfit while those before are
// under way, `in_flight` of them at most.
//
// Reproducibly, point k is chosen by the results of all points up to k - in_flight, those between
// pending even if their results are there: the same points for any number of workers and any order
// of arrival. Where too few of these have a value, results of later points join in order until a
// point can be chosen. At once, a point is chosen by all results that are there
// [Samuelsson 2023, sec. 3.7].

#include <memory>
#include <optional>

#include "server/planning/planner.h"

namespace calib::methods {

/// What is asked where to look next.
enum class ResponseModel { kCubicRbf, kGaussianProcess };

struct SurrogateOptions {
  ResponseModel model = ResponseModel::kCubicRbf;
  /// A run ends when its misfit so far exceeds this times the best run's (a half and a quarter of
  /// it later, inference::TerminationBound); empty: never.
  std::optional<double> termination = 10;
  /// Points under way at most, >= 1. Reproducibly, point k is chosen once all up to k - in_flight
  /// have ended, and by their results alone.
  int in_flight = 8;
};

/// Points that make an iteration after the first; they are chosen one by one.
inline constexpr int kPointsOfABatch = 8;

/// Keeps a reference to the definition.
std::unique_ptr<planning::Planner> MakeSurrogatePlanner(const planning::Definition& definition,
                                                        const SurrogateOptions& options);

}  // namespace calib::methods
