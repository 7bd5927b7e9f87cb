#pragma once
// Which document a request asks for.

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "server/page/target.h"

namespace calib::page {

enum class Document {
  kList,
  kShow,
  kLineage,
  kPosterior,
  kCompare,
  kDiagnosis,
  kImprovement,
  kSamples,
  kStates,
  kGrains,
  kWorkers,
  kMetrics,  ///< a text, as is kReady
  kReady,
};

struct Question {
  Document document = Document::kList;
  std::string campaign{};          ///< lower-case letters and digits; empty: of all campaigns
  std::optional<int> number{};     ///< sample of kStates and kGrains; iteration of kPosterior
  std::optional<int> limit{};      ///< of kList
  std::string after{};             ///< of kList
  std::string experiment{};        ///< of kGrains; empty: any
  std::optional<int> load_step{};  ///< of kGrains; none: the last

  /// The same for equal questions and for no others.
  std::string Key() const;
};

/// What is asked for by a target under /api/v1/ that is not `events`. NOT_FOUND: there is no such
/// address; INVALID_ARGUMENT: a number that is none. Pure.
absl::StatusOr<Question> ParseQuestion(const Target& target);

}  // namespace calib::page
