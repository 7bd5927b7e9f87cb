#include "worker/once.h"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iostream>
#include <optional>
#include <ostream>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "dem/model/state.h"
#include "dem/registry/catalog.h"
#include "dem/simulate/simulate.h"
#include "dem/simulate/whole_file.h"
#include "proto/rpc/digest.h"
#include "worker/engine/evaluate.h"
#include "worker/engine/scenario_from_spec.h"
#include "worker/message_file.h"

namespace calib::worker {
namespace {

/// The packing file and the meshes that a single evaluation needs, told apart by their digests.
Fetch FromFiles(const v1::AttemptSpec& spec, const OnceOptions& options) {
  const std::string packing =
      spec.has_recipe() ? spec.recipe().sizes_digest() : spec.packing_digest();
  return [packing, options](const std::string& digest,
                            std::stop_token) -> absl::StatusOr<std::string> {
    const bool mesh = digest != packing;
    const std::vector<std::string> paths = mesh ? options.meshes
                                           : options.packing.empty()
                                               ? std::vector<std::string>{}
                                               : std::vector<std::string>{options.packing};
    std::string found = mesh ? "the spec names a mesh: give its file with --mesh"
                             : "the spec names a packing file: give it with --packing";
    for (const std::string& path : paths) {
      auto content = ContentOf(path);
      if (!content.has_value()) {
        return absl::InvalidArgumentError(absl::StrCat(path, ": cannot be read"));
      }
      const std::string has = rpc::Sha256Hex(*content);
      if (has == digest) {
        return *std::move(content);
      }
      found = absl::StrCat(path, ": has SHA-256 ", has, ", the spec wants ", digest);
    }
    return absl::InvalidArgumentError(found);
  };
}

/// Why the run cannot go on from a checkpoint; empty: it can, or has no packing, which it says
/// itself.
std::string ProblemWith(const std::string& checkpoint, const v1::AttemptSpec& spec,
                        Specimens& specimens) {
  const auto specimen = specimens.Get(spec, {});
  if (!specimen.ok()) {
    return "";
  }
  dem::Scenario scenario = ScenarioFromSpec(spec);
  scenario.packing = (*specimen)->packing;
  scenario.meshes = (*specimen)->meshes;
  return dem::CheckpointProblem(scenario, checkpoint);
}

}  // namespace

int RunOnce(const OnceOptions& options, std::ostream& errors) {
  v1::AttemptSpec read;
  if (const absl::Status status = ReadMessageFile(options.spec, read); !status.ok()) {
    errors << status.message() << '\n';
    return kBadSpec;
  }
  const v1::AttemptSpec* const spec = &read;
  const dem::TestInfo* test = dem::FindTest(spec->test());
  if (test == nullptr) {
    errors << options.spec << ": there is no test \"" << spec->test() << "\"\n";
    return kBadSpec;
  }
  Specimens specimens(FromFiles(*spec, options));
  dem::Recording recording{.vtk_directory = options.vtk, .vtk_load_step = options.load_step};
  if (!options.checkpoint.empty()) {
    recording.resume_from = ContentOf(options.checkpoint).value_or("");
    recording.checkpoint = [&](const std::string& checkpoint) {
      return dem::WriteWholeFile(options.checkpoint, checkpoint);
    };
    if (std::filesystem::exists(options.checkpoint)) {
      if (const auto problem = ProblemWith(recording.resume_from, *spec, specimens);
          !problem.empty()) {
        errors << options.checkpoint << ": " << problem
               << "; without this file the run starts from the beginning\n";
        return kRefusedCheckpoint;
      }
    }
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
  for (const std::string& name : test->observables) {
    out << ',' << name;
  }
  out << '\n';

  std::stop_source far_enough;
  const auto write = [&](const dem::State& state) {
    std::string row = std::to_string(state.load_step);
    for (const double value : state.values) {
      row += fmt::format(",{:.17g}", value);
    }
    out << row << std::endl;  // a reader sees each state when it is reached
    if (state.load_step == options.load_step) {
      far_enough.request_stop();  // looked at once this state has been drawn
    }
  };
  const v1::Finished finished =
      Evaluate(*spec, specimens, write, far_enough.get_token(), recording);
  if (finished.outcome() == v1::Finished::OUTCOME_COMPLETED ||
      (finished.outcome() == v1::Finished::OUTCOME_STOPPED && far_enough.stop_requested())) {
    return kCompleted;
  }
  errors << finished.reason() << '\n';
  return finished.outcome() == v1::Finished::OUTCOME_DIVERGED ? kModelDiverged : kBadSpec;
}

}  // namespace calib::worker
