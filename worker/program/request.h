#pragma once
// What a program is asked, and the texts that stand for {NAME}. Pure.

#include <map>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "calib/v1/worker.pb.h"

namespace calib::worker {

/// The request as one line of JSON without its end: run, experiment, realization, parameters,
/// units, effects, settings, control, observables, seed, threads. Numbers are read back to the same
/// bits. INVALID_ARGUMENT: the settings are no JSON object.
absl::StatusOr<std::string> RequestText(const v1::ProgramRun& program, const std::string& run);

/// {"stop": RUN}, a line without its end.
std::string StopText(const std::string& run);

/// What {NAME} stands for: numbers, texts, true and false of the settings, parameters, which come
/// before settings of the same name, and before both the reserved scratch, threads, seed.
/// INVALID_ARGUMENT as above.
absl::StatusOr<std::map<std::string, std::string>> Replacements(const v1::ProgramRun& program,
                                                                const std::string& scratch);

/// The text with {NAME} replaced, once: the exact names only, never after '$'; other braces stay.
std::string Replaced(std::string_view text, const std::map<std::string, std::string>& replacements);

}  // namespace calib::worker
