#pragma once
// The answer of a design from what its runs say: evidences, misfits and strengths put together.
// Pure.

#include <functional>
#include <map>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "server/diagnosis/answer.h"
#include "server/diagnosis/base_misfit.h"
#include "server/diagnosis/knowledge.h"

namespace calib::diagnosis {

/// Chances of fresh runs by effect (ChancesOf); empty: none were made.
using VerificationChances = std::optional<std::map<std::string, double>>;

/// What an answer says of the base model's misfit.
void TellMisfit(const BaseMisfit& misfit, Answer& answer);

/// Chance that a right model misses what was measured in a further test as far as this one does at
/// the closest of its draws.
using ChanceElsewhere = std::function<double(const inference::ModelEvidence& model)>;

/// The answer but for Answer::runs. asked: with Effort::kToAnswer; level: of the adequacy test;
/// elsewhere: null where nothing was measured in further tests.
/// Errors: those of AnswerFrom and DescribeEffects.
absl::StatusOr<Answer> AnswerOfDesign(const KnownBefore& before, const Knowledge& known,
                                      const Asked& asked, const BaseMisfit& misfit,
                                      const VerificationChances& verification, double level,
                                      const ChanceElsewhere& elsewhere = nullptr);

}  // namespace calib::diagnosis
