#pragma once
// Which physical effect is missing in a calibrated model: the answer of its design, with what is
// doubtful about it and the test that would tell more.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/client/laboratory.h"
#include "server/diagnosis/answer.h"
#include "server/diagnosis/next_experiment.h"
#include "server/diagnosis/then_answer.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// A measurement that was told, and the runs that it took.
struct ToldMeasurement {
  PlannedExperiment plan{};
  std::string file{}, digest{};  ///< name, and SHA-256 of its content
  std::string campaign{};        ///< id; empty: no runs were needed
  std::int64_t evaluations = 0;
};

struct Diagnosis {
  std::string campaign{};  ///< id
  Answer answer{};
  std::string design{};        ///< id of the campaign that holds the runs; empty: none were made
  std::string borrowed{};      ///< id of another campaign's design that it rests on; empty: none
  bool only_adequacy = false;  ///< no effect was tried
  /// Evaluations made for the answer, those of an earlier call included.
  std::int64_t evaluations = 0;
  int packings = 0;  ///< that the best estimate was run on; 0: scatter is that of twins, or of runs
  std::optional<NextExperiment> next_experiment{};
  std::optional<ToldMeasurement> then{};  ///< of which the answer knows too
  std::vector<std::string> left_out{};    ///< effects that did not take part, as asked for
  /// The errors are stated too small or too large by what the readings show, or readings are few:
  /// what is said rests on them.
  bool in_doubt = false;
  std::vector<std::string>
      warnings{};  ///< about noise, readings, packings and runs, a sentence each
  std::map<std::string, std::string> units{};  ///< SI, of the strengths of effects
};

struct DiagnosisOptions {
  double level = 0.01;                    ///< of the adequacy test
  bool only_adequacy = false;             ///< no runs: says adequate or unexplained
  std::vector<std::string> without = {};  ///< effects that do not take part
  /// Of the design, on the fitted experiments; those that were made before count too.
  std::optional<std::int64_t> max_evaluations = {};
  std::string design = {};      ///< id of another campaign's design that the answer rests on
  bool next_experiment = true;  ///< where the model is not adequate: what to measure next
  /// A proposal of an earlier answer that has been measured: the answer is that of both, and plans
  /// no further one.
  std::optional<MadeMeasurement> then = {};
};

/// Errors: FAILED_PRECONDITION with a sentence when nothing can be said (no posterior, noise not
/// given independently, too few runs); RESOURCE_EXHAUSTED when max_evaluations does not suffice;
/// those of the runs and of AnswerWith. Where the next experiment alone cannot be planned, a
/// warning.
absl::StatusOr<Diagnosis> Diagnose(client::Laboratory& laboratory, const report::CampaignView& view,
                                   const DiagnosisOptions& options = {});

std::string DiagnosisJson(const Diagnosis& diagnosis);
std::string DiagnosisText(const Diagnosis& diagnosis);

}  // namespace calib::diagnosis
