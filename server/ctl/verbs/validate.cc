#include <iostream>
#include <string>

#include "server/campaign/file/read_precomputed.h"
#include "server/campaign/model/noise_check.h"
#include "server/campaign/model/specimen_notes.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/source_files.h"
#include "server/ctl/verb.h"
#include "server/report/documents/json_documents.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

struct ValidateOptions {
  std::string file;
};

void Declare(OptionList& list, ValidateOptions& options) { list.CampaignFile(options.file); }

absl::StatusOr<int> Validate(const CommonOptions& common, const ValidateOptions& options) {
  const auto source = ReadSourceFiles(options.file, std::nullopt, common.json);
  if (!source) return kBadInput;
  const campaign::Campaign& campaign = source->outcome.campaign;
  const std::vector<std::string> notes = campaign::SpecimenNotes(campaign);
  std::vector<std::string> warnings = campaign::NoiseWarnings(campaign);
  for (std::string& warning : campaign::RepeatedRunWarnings(campaign)) {
    warnings.push_back(std::move(warning));
  }
  if (common.json) {
    std::cout << report::ProblemsJson({}, warnings, notes);
    return kDone;
  }
  std::size_t readings = 0;
  for (const campaign::Experiment& experiment : campaign.experiments) {
    readings += experiment.control.size() * experiment.observables.size();
  }
  std::cout << options.file << " is good: " << campaign.parameters.size() << " parameters, "
            << campaign.experiments.size() << " experiment(s), " << readings
            << " measured numbers, " << campaign.samples << " samples in each of at most "
            << campaign.max_iterations << " iteration(s).\n";
  for (const std::string& note : notes) std::cout << report::Wrapped(note, "  ", "  ");
  for (const std::string& warning : warnings) std::cout << report::Wrapped(warning, "! ", "  ");
  return kDone;
}

}  // namespace

Verb ValidateVerb() {
  return MakeVerb<ValidateOptions>(
      {.name = "validate",
       .description = "Everything that submit checks, without a server",
       .example = "validate sand.yaml"},
      &Declare, &Validate);
}

}  // namespace calib::ctl
