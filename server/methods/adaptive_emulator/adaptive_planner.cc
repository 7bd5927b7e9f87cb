#include "server/methods/adaptive_emulator/adaptive_planner.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/return_if_error.h"
#include "inference/data/data_set.h"
#include "inference/diagnosis/stage_projection.h"
#include "inference/filter/parameter_summary.h"
#include "inference/numerics/weighted_moments.h"
#include "server/campaign/model/word_table.h"
#include "server/planning/json_vectors.h"
#include "server/planning/plan_memory.h"
#include "server/planning/scatter.h"

namespace calib::methods {
namespace {

using campaign::Word;
using Eigen::Index;
using inference::AdaptiveStage;
using Json = nlohmann::json;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// sd by which the means of two emulators of the same runs may differ: twice what
/// AdaptiveOptions::mean_error lets one be off.
constexpr double kMayDiffer = 0.3;

constexpr std::array kStageWords = {
    Word{AdaptiveStage::kFirst, "first"},
    Word{AdaptiveStage::kSearching, "searching"},
    Word{AdaptiveStage::kVerifying, "verifying"},
    Word{AdaptiveStage::kConverged, "converged"},
    Word{AdaptiveStage::kRefused, "refused"},
    Word{AdaptiveStage::kNotConverged, "not_converged"},
};

/// The readings of a campaign as its coordinates: matrix * readings in `order`.
struct Coordinates {
  std::vector<Index> order;  ///< T, of the data's readings: curve after curve
  Eigen::MatrixXd matrix;    ///< q x T
};

/// One curve for each observable of each experiment.
Coordinates MakeCoordinates(const planning::Definition& definition) {
  std::map<std::pair<int, int>, std::vector<Index>> readings;
  for (std::size_t k = 0; k < definition.data.readings.size(); ++k) {
    const inference::Reading& reading = definition.data.readings[k];
    readings[{reading.experiment, reading.observable}].push_back(static_cast<Index>(k));
  }
  Coordinates result;
  std::vector<inference::PathCurve> curves;
  for (const auto& [of, rows] : readings) {
    const auto& experiment = definition.campaign.experiments[static_cast<std::size_t>(of.first)];
    inference::PathCurve& curve = curves.emplace_back();
    curve.path.resize(static_cast<Index>(rows.size()));
    std::map<std::string, int> stages;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const auto& reading = definition.data.readings[static_cast<std::size_t>(rows[i])];
      const auto step = static_cast<std::size_t>(reading.load_step);
      const std::string stage = step < experiment.segment.size() ? experiment.segment[step] : "";
      curve.stage.push_back(stages.emplace(stage, static_cast<int>(stages.size())).first->second);
      curve.path[static_cast<Index>(i)] = reading.control;
      result.order.push_back(rows[i]);
    }
  }
  result.matrix = inference::ProjectStages(curves).matrix;
  return result;
}

/// q coordinates of a history; not a number where readings that one needs are.
Eigen::VectorXd Project(const Coordinates& coordinates, const Eigen::RowVectorXd& history) {
  Eigen::VectorXd result = Eigen::VectorXd::Zero(coordinates.matrix.rows());
  for (Index m = 0; m < result.size(); ++m) {
    for (Index t = 0; t < coordinates.matrix.cols(); ++t) {
      const double weight = coordinates.matrix(m, t);
      if (weight != 0)
        result[m] += weight * history[coordinates.order[static_cast<std::size_t>(t)]];
    }
  }
  return result;
}

/// The number of batches at which a decision that did not wait for the last found no runs.
struct NoneBeforeTheLast final : planning::PlannerMemory {
  std::size_t batches = 0;
};

struct Memory {
  inference::AdaptiveMemory of_decision;
  double expected_gain = 0;
};

std::string ToText(const Memory& memory) {
  return Json{{"stage", campaign::WordOf(kStageWords, memory.of_decision.stage)},
              {"mean", planning::VectorToJson(memory.of_decision.mean)},
              {"sd", planning::VectorToJson(memory.of_decision.sd)},
              {"batches", memory.of_decision.batches},
              {"uncertain", memory.of_decision.uncertain},
              {"missing", memory.of_decision.missing},
              {"expected_gain", memory.expected_gain}}
      .dump();
}

/// number: of the batch; without asynchronous decisions all before it had ended.
absl::StatusOr<Memory> FromText(const std::string& text, int number) {
  try {
    const Json json = Json::parse(text);
    const auto stage = campaign::ValueOf(kStageWords, json.at("stage").get<std::string>());
    if (!stage) return absl::DataLossError("a stored batch is of a stage that nobody knows");
    return Memory{
        {*stage, planning::VectorFromJson(json.at("mean")), planning::VectorFromJson(json.at("sd")),
         json.value("batches", number), json.value("uncertain", 0), json.value("missing", 0)},
        json.at("expected_gain").get<double>()};
  } catch (const Json::exception& error) {
    return absl::DataLossError(absl::StrCat("stored batch: ", error.what()));
  }
}

class AdaptivePlanner final : public planning::Planner {
 public:
  AdaptivePlanner(const planning::Definition& definition, const inference::AdaptiveOptions& options)
      : definition_(definition),
        campaign_(definition.campaign),
        options_(options),
        coordinates_(MakeCoordinates(definition)) {
    options_.seed = campaign_.seed;
    for (const campaign::CalibratedParameter& p : campaign_.parameters) {
      options_.names.push_back(p.name);
    }
    problem_.prior = definition.priors;
    Eigen::RowVectorXd measured(static_cast<Index>(definition.data.readings.size()));
    for (Index k = 0; k < measured.size(); ++k) {
      measured[k] = definition.data.readings[static_cast<std::size_t>(k)].value;
    }
    problem_.measured = Project(coordinates_, measured);
    const Eigen::MatrixXd errors = inference::ErrorCovariance(definition.data);
    problem_.noise = coordinates_.matrix * errors(coordinates_.order, coordinates_.order) *
                     coordinates_.matrix.transpose();
    problem_.share = planning::LargestScatterShare(campaign_);
    problem_.packings =
        static_cast<int>(std::max<std::size_t>(1, campaign::PackingsOfAll(campaign_)));
    if (planning::GivenRuns(campaign_) == 0) return;
    options_.given.parameters = campaign_.table->parameters;
    for (const int stream : campaign_.table->like) {
      options_.given.packing.push_back(stream % problem_.packings);
      first_round_ = std::max(first_round_, stream / problem_.packings + 1);
    }
  }

  absl::StatusOr<planning::Batch> First() const override {
    if (campaign_.precomputed) {
      const Eigen::MatrixXd& rows = campaign_.precomputed->parameters;
      return planning::Batch{
          .proposal = ToText({}),
          .parameters = rows,
          .stop_below = std::vector<double>(static_cast<std::size_t>(rows.rows()), store::kUnknown),
          .refused = {}};
    }
    ASSIGN_OR_RETURN(const auto decision, inference::DecideAdaptive(problem_, {}, {}, options_));
    if (decision.stage == AdaptiveStage::kRefused) {
      return absl::FailedPreconditionError(decision.reason);
    }
    return BatchOf(decision, 0, 0);
  }

  absl::StatusOr<planning::Outcome> Conclude(const planning::History& history,
                                             bool affordable) const override {
    ASSIGN_OR_RETURN(const auto memories, MemoriesOf(history));
    const inference::AdaptiveRuns runs = RunsOf(history, history.iterations.size());
    if (runs.rows() == 0) {
      return absl::FailedPreconditionError("no row of the tables lies within the priors");
    }
    ASSIGN_OR_RETURN(const auto decision,
                     inference::DecideAdaptive(problem_, runs, OfDecisions(memories), options_));
    if (decision.stage == AdaptiveStage::kRefused) {
      return absl::FailedPreconditionError(decision.reason);
    }
    ASSIGN_OR_RETURN(auto answer, BestRunAndMeans(history, *decision.posterior));
    planning::Outcome outcome{
        .answer = std::move(answer),
        .converged = false,
        .log = absl::StrCat(runs.rows(), " runs, ", campaign::WordOf(kStageWords, decision.stage)),
        .next = {}};
    for (std::size_t k = 0; k < memories.size(); ++k) {
      outcome.answer.batches.push_back(
          {.runs = static_cast<int>(history.iterations[k].parameters.rows()),
           .expected_gain = memories[k].expected_gain});
    }
    const bool goes_on = decision.next.parameters.rows() > 0 && !campaign_.precomputed;
    if (goes_on && affordable) {
      outcome.next = BatchOf(decision, static_cast<int>(history.iterations.size()),
                             static_cast<int>(runs.rows()));
      return outcome;
    }
    const bool tells = !campaign_.precomputed && !decision.reason.empty();
    if (tells) outcome.answer.warnings.push_back(decision.reason);
    if (goes_on) {
      outcome.answer.warnings.push_back(
          absl::StrCat("Not converged: the budget allows no further batch of ",
                       decision.next.parameters.rows(), " runs."));
    }
    planning::AskEmulator(definition_, history.iterations, outcome.answer);
    // Of runs that were made before there are no more.
    outcome.converged = (decision.stage == AdaptiveStage::kConverged || campaign_.precomputed) &&
                        outcome.answer.FromEmulator() && Agree(*decision.posterior, outcome.answer);
    return outcome;
  }

  // Asked of asynchronous campaigns alone.
  absl::StatusOr<planning::Batch> More(const planning::History& history,
                                       std::int64_t affordable) const override {
    const std::size_t batches = history.iterations.size();
    if (campaign_.precomputed || !HasEnded(history, batches - 1)) return planning::Batch{};
    ASSIGN_OR_RETURN(const auto memories, MemoriesOf(history));
    const std::vector<inference::AdaptiveMemory> earlier = OfDecisions(memories);
    // How many batches are known is the rule's, whatever else has arrived.
    const auto decide = [&](std::size_t known,
                            std::int64_t most) -> absl::StatusOr<planning::Batch> {
      const inference::AdaptiveRuns runs = RunsOf(history, known);
      ASSIGN_OR_RETURN(const auto decision,
                       inference::DecideAdaptive(problem_, runs, earlier, options_));
      if (decision.stage == AdaptiveStage::kRefused) {
        return absl::FailedPreconditionError(decision.reason);
      }
      if (decision.next.parameters.rows() > most) return planning::Batch{};
      return BatchOf(decision, static_cast<int>(batches), static_cast<int>(runs.rows()));
    };
    std::size_t& none_at = definition_.memory->Of<NoneBeforeTheLast>().batches;
    if (inference::MayOverlap(earlier) && none_at != batches) {
      auto batch = decide(batches - 1, AffordableWhateverArrives(history, affordable));
      if (batch.ok() && batch->parameters.rows() > 0) return batch;
      none_at = batches;
    }
    return HasEnded(history, batches) ? decide(batches, affordable) : planning::Batch{};
  }

 private:
  /// Runs that the budget allows beside all asked for so far at their full price: what those under
  /// way have cost by now goes by who is quick. Core hours are never the same twice.
  std::int64_t AffordableWhateverArrives(const planning::History& history,
                                         std::int64_t affordable) const {
    const campaign::Budget& budget = campaign_.budget;
    std::int64_t most = budget.core_hours ? affordable : std::numeric_limits<std::int64_t>::max();
    if (budget.model_evaluations) {
      const auto tests = std::ssize(definition_.ExperimentsOf(campaign::Role::kCalibrate));
      most = std::min(most, *budget.model_evaluations / tests - std::ssize(history.samples));
    }
    return most;
  }

  /// Whether all runs of the first `batches` have.
  static bool HasEnded(const planning::History& history, std::size_t batches) {
    for (std::size_t k = 0; k < batches; ++k) {
      const std::vector<char>& ended = history.ended[k];
      if (std::find(ended.begin(), ended.end(), 0) != ended.end()) return false;
    }
    return true;
  }

  static absl::StatusOr<std::vector<Memory>> MemoriesOf(const planning::History& history) {
    std::vector<Memory> memories;
    for (const std::string& proposal : history.proposals) {
      ASSIGN_OR_RETURN(auto memory, FromText(proposal, static_cast<int>(memories.size())));
      memories.push_back(std::move(memory));
    }
    return memories;
  }

  static std::vector<inference::AdaptiveMemory> OfDecisions(const std::vector<Memory>& memories) {
    std::vector<inference::AdaptiveMemory> result;
    result.reserve(memories.size());
    for (const Memory& memory : memories) result.push_back(memory.of_decision);
    return result;
  }

  /// iteration: its number; made: runs before it.
  planning::Batch BatchOf(const inference::AdaptiveDecision& decision, int iteration,
                          int made) const {
    planning::Batch batch{
        .proposal = ToText({.of_decision = decision.memory,
                            .expected_gain = iteration == 0 ? 0 : decision.next.expected_gain}),
        .parameters = decision.next.parameters,
        .stop_below = std::vector<double>(decision.next.packing.size(), store::kUnknown),
        .refused = {}};
    const bool begins = iteration == 0 && planning::GivenRuns(campaign_) > 0;
    if (begins) batch.streams = campaign_.table->like;
    for (std::size_t i = batch.streams.size(); i < decision.next.packing.size(); ++i) {
      const int round = first_round_ + made + static_cast<int>(i);
      batch.streams.push_back(problem_.packings * round + decision.next.packing[i]);
    }
    return batch;
  }

  /// known: batches of which results are taken; runs of the others are pending.
  inference::AdaptiveRuns RunsOf(const planning::History& history, std::size_t known) const {
    Index rows = 0;
    for (const inference::Iteration& batch : history.iterations) rows += batch.parameters.rows();
    inference::AdaptiveRuns runs;
    runs.parameters.resize(rows, static_cast<Index>(problem_.prior.size()));
    runs.coordinates.resize(rows, problem_.measured.size());
    std::vector<Index> inside;  // rows made elsewhere may lie anywhere
    Index row = 0;
    for (std::size_t k = 0; k < history.iterations.size(); ++k) {
      const inference::Iteration& batch = history.iterations[k];
      for (Index i = 0; i < batch.parameters.rows(); ++i, ++row) {
        const store::SampleRecord& sample = history.samples[static_cast<std::size_t>(row)];
        runs.parameters.row(row) = batch.parameters.row(i);
        if (!campaign_.precomputed || problem_.prior.InSupport(batch.parameters.row(i).transpose()))
          inside.push_back(row);
        runs.packing.push_back(sample.stream.value_or(0) % problem_.packings);
        runs.batch.push_back(static_cast<int>(k));
        if (k >= known) {
          runs.coordinates.row(row).setConstant(planning::kNone);
          runs.end.push_back(inference::RunEnd::kPending);
          continue;
        }
        const bool complete = batch.predictions.row(i).allFinite();
        runs.coordinates.row(row) =
            Project(coordinates_, complete ? batch.predictions.row(i) : history.stopped[k].row(i));
        runs.end.push_back(complete                                   ? inference::RunEnd::kComplete
                           : history.unknown.count(sample.sample) > 0 ? inference::RunEnd::kUnknown
                           : runs.coordinates.row(row).array().isFinite().any()
                               ? inference::RunEnd::kEarly
                               : inference::RunEnd::kDiverged);
      }
    }
    return runs.Only(inside);
  }

  /// What is known without widths: the most likely run, and where the posterior lies.
  absl::StatusOr<planning::Answer> BestRunAndMeans(
      const planning::History& history, const inference::AdaptivePosterior& posterior) const {
    ASSIGN_OR_RETURN(const auto batches, planning::LogLikelihoodsByBatch(definition_, history));
    Eigen::VectorXd likelihood(static_cast<Index>(history.samples.size()));
    Index row = 0;
    for (const Eigen::VectorXd& batch : batches) {
      likelihood.segment(row, batch.size()) = batch;
      row += batch.size();
    }
    Index best = 0;
    likelihood.maxCoeff(&best);
    planning::Answer answer;
    inference::Posterior& weighted = answer.weighted;
    weighted.log_weights = Eigen::VectorXd::Constant(likelihood.size(), -kInfinity);
    weighted.log_weights[best] = 0;
    for (std::size_t j = 0; j < problem_.prior.size(); ++j) {
      weighted.parameters.push_back(inference::Summarize(
          problem_.prior[j], posterior.log_weights, posterior.draws.col(static_cast<Index>(j))));
    }
    answer.weighted_members =
        planning::SummarizeMembers(campaign_, posterior.draws, posterior.log_weights);
    weighted.log_evidence = weighted.log_evidence_se = weighted.pareto_k = planning::kNone;
    weighted.ess = 1;
    weighted.degeneracy =
        "Runs were placed where the posterior was least certain and are no draws of it.";
    return answer;
  }

  /// Whether the two emulators give one posterior; tells where they do not.
  bool Agree(const inference::AdaptivePosterior& own, planning::Answer& answer) const {
    const Eigen::MatrixXd standard =
        inference::StandardRows(problem_.prior, answer.emulated->draws);
    const Eigen::RowVectorXd mean = standard.colwise().mean();
    bool agree = true;
    for (Index j = 0; j < mean.size(); ++j) {
      const double apart = std::abs(mean[j] - own.mean[j]) / own.sd[j];
      if (apart <= kMayDiffer) continue;
      agree = false;
      answer.warnings.push_back(absl::StrFormat(
          "Two emulators of these runs differ by %.2f sd in the mean of %s: not converged.", apart,
          options_.names[static_cast<std::size_t>(j)]));
    }
    return agree;
  }

  const planning::Definition& definition_;
  const campaign::Campaign& campaign_;
  inference::AdaptiveOptions options_;
  int first_round_ = 0;  // of streams, behind those that are given
  Coordinates coordinates_;
  inference::AdaptiveProblem problem_;
};

}  // namespace

std::unique_ptr<planning::Planner> MakeAdaptivePlanner(const planning::Definition& definition,
                                                       const inference::AdaptiveOptions& options) {
  return std::make_unique<AdaptivePlanner>(definition, options);
}

}  // namespace calib::methods
