#pragma once
// What each effect of a race does to a measurement's misfit: strength, error, curves, and what a
// second specimen would tell. Pure.

#include "absl/status/status.h"
#include "server/diagnosis/answer.h"
#include "server/diagnosis/knowledge.h"

namespace calib::diagnosis {

/// Fills what an answer says of its candidates beyond their probabilities, and points of the models
/// that are asked for. asked: with Effort::kToAnswer, the models
/// of the answer. Errors: those of ExpectedInformation.
absl::Status DescribeEffects(const KnownBefore& before, const Knowledge& known, const Asked& asked,
                             Answer& answer);

}  // namespace calib::diagnosis
