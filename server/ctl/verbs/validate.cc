#include <iostream>

#include "server/campaign/file/read_precomputed.h"
#include "server/campaign/model/noise_check.h"
#include "server/campaign/model/specimen_notes.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/source_files.h"
#include "server/ctl/verbs.h"
#include "server/report/documents/json_documents.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {

int Validate(const Arguments& arguments) {
  const auto source = ReadSourceFiles(arguments);
  if (!source) return kBadInput;
  const campaign::Campaign& campaign = source->outcome.campaign;
  const std::vector<std::string> notes = campaign::SpecimenNotes(campaign);
  std::vector<std::string> warnings = campaign::NoiseWarnings(campaign);
  for (std::string& warning : campaign::RepeatedRunWarnings(campaign)) {
    warnings.push_back(std::move(warning));
  }
  if (arguments.json) {
    std::cout << report::ProblemsJson({}, warnings, notes);
    return kDone;
  }
  std::size_t readings = 0;
  for (const campaign::Experiment& experiment : campaign.experiments) {
    readings += experiment.control.size() * experiment.observables.size();
  }
  std::cout << arguments.file << " is good: " << campaign.parameters.size() << " parameters, "
            << campaign.experiments.size() << " experiment(s), " << readings
            << " measured numbers, " << campaign.samples << " samples in each of at most "
            << campaign.max_iterations << " iteration(s).\n";
  for (const std::string& note : notes) std::cout << report::Wrapped(note, "  ", "  ");
  for (const std::string& warning : warnings) std::cout << report::Wrapped(warning, "! ", "  ");
  return kDone;
}

}  // namespace calib::ctl
