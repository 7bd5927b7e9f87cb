#include "worker/program_once.h"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <stop_token>

#include "absl/strings/str_cat.h"
#include "worker/message_file.h"
#include "worker/once.h"
#include "worker/program/programs.h"

namespace calib::worker {
namespace {

std::string ReportText(const ProgramReport& report, const v1::Finished& finished) {
  nlohmann::json kept = nlohmann::json::array();
  for (const auto& file : report.kept) kept.push_back(file.name);
  nlohmann::json not_kept = nlohmann::json::array();
  for (const auto& [name, why] : report.not_kept) not_kept.push_back(absl::StrCat(name, " ", why));
  const nlohmann::json json = {{"request", report.request},
                               {"ignored_lines", report.ignored_lines},
                               {"ignored", report.ignored},
                               {"wall_seconds", report.wall_seconds},
                               {"core_seconds", finished.core_seconds()},
                               {"peak_memory", report.peak_memory},
                               {"all_at_once", report.all_at_once},
                               {"words", report.words},
                               {"kept", kept},
                               {"not_kept", not_kept}};
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace

int RunProgramOnce(const ProgramOnceOptions& options, std::ostream& errors) {
  v1::ProgramRun run;
  if (const absl::Status status = ReadMessageFile(options.run, run); !status.ok()) {
    errors << status.message() << '\n';
    return kBadSpec;
  }
  std::ofstream file;
  if (!options.output.empty()) {
    file.open(options.output);
    if (!file) {
      errors << options.output << ": cannot be written\n";
      return kBadSpec;
    }
  }
  std::ostream& out = options.output.empty() ? std::cout : file;
  out << "load_step";
  for (const std::string& name : run.observables()) out << ',' << name;
  out << std::endl;
  Programs programs({.fetch = [&options](const std::string& digest,
                                         std::stop_token) -> absl::StatusOr<std::string> {
                       auto content =
                           ContentOf((std::filesystem::path(options.files) / digest).string());
                       if (!content) {
                         return absl::NotFoundError(
                             absl::StrCat("there is no file ", digest, " in ", options.files));
                       }
                       return *std::move(content);
                     },
                     .scratch = options.scratch,
                     .allowed = {"*"}});
  const auto write = [&out](const v1::State& state) {
    if (state.values().empty()) return;  // what it tells besides
    std::string row = std::to_string(state.load_step());
    for (const double value : state.values()) row += fmt::format(",{:.17g}", value);
    out << row << std::endl;  // a reader sees each state when it is reached
  };
  ProgramReport report;
  const v1::Finished finished = programs.Evaluate(run, 1, write, {}, &report);
  if (!options.report.empty()) {
    std::ofstream(options.report) << ReportText(report, finished) << '\n';
  }
  if (finished.outcome() == v1::Finished::OUTCOME_COMPLETED) return kCompleted;
  errors << finished.reason() << '\n';
  return finished.outcome() == v1::Finished::OUTCOME_DIVERGED ? kModelDiverged : kBadSpec;
}

}  // namespace calib::worker
