#include "inference/surrogate/response_surface.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/numerics/infinity.h"
#include "inference/sampling/latin_hypercube.h"
#include "inference/sampling/philox.h"
#include "inference/surrogate/merit.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr int kCandidatesPerDimension = 100;  // [Samuelsson 2023, Table 4.2]
constexpr int kStartDesigns = 1000;  // drawn for the best of them [Samuelsson 2023, sec. 3.2]
// Designs tried; chosen: one that does not span the tail is rare, its points would lie in a plane.
constexpr int kMostDesigns = 100;
constexpr int kTries = 1'000'000;  // of a point that is admissible; chosen: below a second
// How a perturbation that is not admissible comes closer; chosen.
constexpr int kPerStep = 20;          // draws before the step is halved
constexpr double kLeastStep = 1e-12;  // of the cube's edge: the point itself is taken

int InitialPoints(const ResponseSurfaceOptions& options) {
  return options.initial_points > 0 ? options.initial_points
                                    : 2 * options.dimensions + 1 + options.workers;
}

bool IsAdmissible(const ResponseSurfaceOptions& options, const Eigen::VectorXd& point) {
  return !options.admissible || options.admissible(point);
}

// Perturbations of the best point, cut off at the faces of the cube so that an optimum on a face
// can be met exactly.
Eigen::MatrixXd Candidates(const ResponseSurfaceOptions& options,
                           const ResponseSurfaceState& state) {
  const int count =
      options.candidates > 0 ? options.candidates : kCandidatesPerDimension * options.dimensions;
  const Eigen::VectorXd& best = state.evaluations[static_cast<std::size_t>(state.best)].point;
  Eigen::MatrixXd candidates(options.dimensions, count);
  for (Index k = 0; k < count; ++k) {
    PhiloxStream stream({.seed = options.seed,
                         .purpose = StreamPurpose::kResponseSurface,
                         .iteration = state.evaluations.size(),
                         .sample = static_cast<std::uint64_t>(k)});
    candidates.col(k) = Perturbed(options, best, state.step, stream);
  }
  return candidates;
}

// The given points, then those of the hypercube.
Eigen::MatrixXd Joined(const Eigen::MatrixXd& first, const Eigen::MatrixXd& hypercube) {
  Eigen::MatrixXd design(first.rows() + hypercube.rows(), hypercube.cols());
  if (first.rows() > 0) design.topRows(first.rows()) = first;
  design.bottomRows(hypercube.rows()) = hypercube;
  return design;
}

// Uniform draws in the place of design points that are not admissible.
absl::Status ReplaceInadmissible(const ResponseSurfaceOptions& options, Eigen::MatrixXd& design) {
  constexpr std::uint64_t kDesign = ~std::uint64_t{0};  // no count of evaluations
  for (Index i = 0; i < design.rows(); ++i) {
    Eigen::VectorXd point = design.row(i);
    PhiloxStream stream({.seed = options.seed,
                         .purpose = StreamPurpose::kResponseSurface,
                         .iteration = kDesign,
                         .sample = static_cast<std::uint64_t>(i)});
    for (int k = 0; !IsAdmissible(options, point); ++k) {
      if (k == kTries) {
        return absl::FailedPreconditionError(
            "surrogate_msrs: of a million points of the prior none meets the constraints.");
      }
      for (double& value : point) value = stream.Uniform();
    }
    design.row(i) = point;
  }
  return absl::OkStatus();
}

// Distances of a point to the columns' points (m x d).
Eigen::VectorXd Distances(const Eigen::MatrixXd& points, const Eigen::VectorXd& x) {
  Eigen::ArrayXd squares = Eigen::ArrayXd::Zero(points.rows());
  for (Index j = 0; j < points.cols(); ++j) squares += (points.col(j).array() - x[j]).square();
  return squares.sqrt();
}

Eigen::VectorXd ChoosePoint(const ResponseSurfaceOptions& options, const CubicRbf& surrogate,
                            const ResponseSurfaceState& state) {
  const Eigen::MatrixXd candidates = Candidates(options, state);
  Eigen::MatrixXd done(surrogate.size(), options.dimensions);
  for (Index i = 0; i < done.rows(); ++i) done.row(i) = surrogate.point(static_cast<int>(i));
  Eigen::MatrixXd others(static_cast<Index>(state.evaluations.size() - state.completed.size()),
                         options.dimensions);
  Index filled = 0;
  for (const Evaluation& evaluation : state.evaluations) {
    if (evaluation.status != EvaluationStatus::kDone) others.row(filled++) = evaluation.point;
  }
  Eigen::VectorXd values(candidates.cols());
  Eigen::VectorXd nearest(candidates.cols());
  for (Index k = 0; k < candidates.cols(); ++k) {
    const Eigen::VectorXd distances = Distances(done, candidates.col(k));
    values[k] = surrogate.Value(candidates.col(k), distances);
    nearest[k] = distances.minCoeff();
    if (others.rows() > 0)
      nearest[k] = std::min(nearest[k], Distances(others, candidates.col(k)).minCoeff());
  }
  const std::size_t turn =
      (state.evaluations.size() - static_cast<std::size_t>(state.design.rows())) %
      options.weights.size();
  return candidates.col(BestCandidate(
      values, nearest, {.weight = options.weights[turn], .min_distance = options.min_distance}));
}

}  // namespace

Eigen::VectorXd Perturbed(const ResponseSurfaceOptions& options, const Eigen::VectorXd& center,
                          double step, PhiloxStream& stream) {
  Eigen::VectorXd point(options.dimensions);
  for (int draw = 1; step >= kLeastStep; ++draw) {
    for (Index j = 0; j < options.dimensions; ++j) {
      point[j] = std::clamp(center[j] + step * stream.Normal(), 0.0, 1.0);
    }
    if (IsAdmissible(options, point)) return point;
    if (draw % kPerStep == 0) step /= 2;
  }
  return center;
}

absl::Status ResponseSurfaceOptions::Validate() const {
  const auto wrong = [](const char* name, double found, const std::string& allowed) {
    return absl::InvalidArgumentError(
        absl::StrCat("surrogate_msrs: ", name, " is ", found, "; allowed is ", allowed, "."));
  };
  if (dimensions < 1) return wrong("dimensions", dimensions, "1 or more");
  if (workers < 1) return wrong("workers", workers, "1 or more");
  if (initial_points != 0 && initial_points < 2 * dimensions + 1) {
    return wrong("initial_points", initial_points,
                 absl::StrCat(2 * dimensions + 1, " or more, or 0"));
  }
  if (first_points.rows() > 0) {
    const Index most = InitialPoints(*this) - 2;
    if (first_points.rows() > most) {
      return wrong("the number of first points", static_cast<double>(first_points.rows()),
                   absl::StrCat("0 to ", most));
    }
    if (first_points.cols() != dimensions) {
      return wrong("the length of a first point", static_cast<double>(first_points.cols()),
                   absl::StrCat(dimensions));
    }
    if (!(first_points.minCoeff() >= 0 && first_points.maxCoeff() <= 1))
      return absl::InvalidArgumentError("surrogate_msrs: a first point lies outside the cube.");
  }
  if (max_evaluations < 2 * dimensions + 1) {
    return wrong("max_evaluations", max_evaluations, absl::StrCat(2 * dimensions + 1, " or more"));
  }
  if (candidates < 0) return wrong("candidates", candidates, "1 or more, or 0");
  if (!(max_step > 0 && max_step <= 1)) return wrong("max_step", max_step, "above 0 up to 1");
  if (!(min_step > 0 && min_step <= max_step))
    return wrong("min_step", min_step, "above 0 up to max_step");
  if (successes_to_double < 1)
    return wrong("successes_to_double", successes_to_double, "1 or more");
  if (failures_to_halve < 1) return wrong("failures_to_halve", failures_to_halve, "1 or more");
  if (weights.empty()) return absl::InvalidArgumentError("surrogate_msrs: weights are missing.");
  for (const double weight : weights) {
    if (!(weight >= 0 && weight <= 1)) return wrong("a weight", weight, "0 to 1");
  }
  if (!(min_distance >= 1e-6 && min_distance < 1))
    return wrong("min_distance", min_distance, "1e-6 up to 1");
  if (!(termination > 0)) return wrong("termination", termination, "above 0");
  return absl::OkStatus();
}

absl::StatusOr<ResponseSurfaceState> StartResponseSurface(const ResponseSurfaceOptions& options) {
  RETURN_IF_ERROR(options.Validate());
  const auto first = static_cast<int>(options.first_points.rows());
  LatinHypercubeOptions design{.points = InitialPoints(options) - first,
                               .dimensions = options.dimensions,
                               .symmetric = true,
                               .candidates = kStartDesigns,
                               .seed = options.seed};
  ResponseSurfaceState state;
  state.step = options.max_step;
  for (int i = 0; i < kMostDesigns; ++i) {
    ASSIGN_OR_RETURN(auto points, LatinHypercube(design));
    state.design = Joined(options.first_points, points);
    RETURN_IF_ERROR(ReplaceInadmissible(options, state.design));
    if (SpansLinearFunctions(state.design)) return state;
    ++design.seed;
  }
  return absl::InternalError("surrogate_msrs: no design spans the linear functions.");
}

std::optional<Eigen::VectorXd> NextPoint(const ResponseSurfaceOptions& options,
                                         ResponseSurfaceState& state, CubicRbf& surrogate) {
  const auto dispatched = static_cast<int>(state.evaluations.size());
  if (dispatched >= options.max_evaluations) return std::nullopt;
  if (dispatched < state.design.rows()) {
    state.evaluations.push_back({.point = state.design.row(dispatched)});
    return state.evaluations.back().point;
  }
  for (auto k = static_cast<std::size_t>(surrogate.size()); k < state.completed.size(); ++k) {
    const Evaluation& evaluation = state.evaluations[static_cast<std::size_t>(state.completed[k])];
    // Points of the design and of the merit lie apart; should two coincide all the same, the first
    // one stands for both and the surrogate is built without the other.
    surrogate.Add(evaluation.point, evaluation.value).IgnoreError();
  }
  if (surrogate.size() < 2 * options.dimensions + 1 || !surrogate.ready()) return std::nullopt;
  state.evaluations.push_back({.point = ChoosePoint(options, surrogate, state)});
  return state.evaluations.back().point;
}

absl::Status Report(const ResponseSurfaceOptions& options, int id, std::optional<double> value,
                    ResponseSurfaceState& state, std::optional<double> at_least) {
  if (id < 0 || id >= static_cast<int>(state.evaluations.size()) ||
      state.evaluations[static_cast<std::size_t>(id)].status != EvaluationStatus::kPending) {
    return absl::InvalidArgumentError(
        absl::StrCat("surrogate_msrs: evaluation ", id, " is not pending."));
  }
  if (!std::isfinite(value.value_or(0)) || !std::isfinite(at_least.value_or(0))) {
    return absl::InvalidArgumentError(
        absl::StrCat("surrogate_msrs: the value of evaluation ", id, " is not finite."));
  }
  Evaluation& evaluation = state.evaluations[static_cast<std::size_t>(id)];
  evaluation.status = value.has_value() ? EvaluationStatus::kDone : EvaluationStatus::kTerminated;
  evaluation.value = value.value_or(0);
  if (!value.has_value()) evaluation.at_least = at_least;
  const bool improved =
      value.has_value() &&
      (state.best < 0 || *value < state.evaluations[static_cast<std::size_t>(state.best)].value);
  if (value.has_value()) state.completed.push_back(id);
  if (improved) state.best = id;
  if (id < state.design.rows()) return absl::OkStatus();
  state.successes = improved ? state.successes + 1 : 0;
  state.failures = improved ? 0 : state.failures + 1;
  if (state.successes == options.successes_to_double) {
    state.step = std::min(2 * state.step, options.max_step);
    state.successes = 0;
  } else if (state.failures == options.failures_to_halve) {
    state.step = std::max(state.step / 2, options.min_step);
    state.failures = 0;
  }
  return absl::OkStatus();
}

double TerminationBound(const ResponseSurfaceOptions& options, int id,
                        const ResponseSurfaceState& state) {
  const auto initial = static_cast<int>(state.design.rows());
  if (id < initial || state.best < 0) return kInfinity;
  const double progress =
      static_cast<double>(id - initial) / std::max(1, options.max_evaluations - initial);
  const double factor =  // [Samuelsson 2023, Eq. 3.4]
      progress < 0.5    ? 1
      : progress < 0.75 ? 0.5
                        : 0.25;
  return factor * options.termination *
         state.evaluations[static_cast<std::size_t>(state.best)].value;
}

}  // namespace calib::inference
