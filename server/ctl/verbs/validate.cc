#include <iostream>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/campaign/checks/experiment_summary.h"
#include "server/campaign/checks/warning.h"
#include "server/campaign/file/parameters/setting_names.h"
#include "server/campaign/model/specimen_notes.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/source_files.h"
#include "server/ctl/verb.h"
#include "server/report/documents/json_documents.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

struct ValidateOptions {
  std::string file;
};

// What was read: the first look at a new file.
std::string Shown(const campaign::ExperimentSummary& summary) {
  std::string text = absl::StrCat("\n", summary.name);
  if (!summary.control.empty()) {
    absl::StrAppend(&text, ": ", summary.control, " from ",
                    report::NumberWithUnit(summary.from, summary.control, summary.control_unit),
                    " to ",
                    report::NumberWithUnit(summary.to, summary.control, summary.control_unit), ", ",
                    summary.turning_points, " turning points");
  }
  if (summary.grains > 0) {
    absl::StrAppend(&text, "; ", summary.grains, " grains, d50 ",
                    report::NumberWithUnit(summary.d50, "d50", "m"), ", porosity ",
                    report::Number(summary.porosity, 3));
  }
  report::TextTable table(
      {"<observable", "readings", "missing", "first", "last", "sd from", "sd to"});
  for (const campaign::ObservableSummary& o : summary.observables) {
    const auto shown = [&o](double value) { return report::NumberWithUnit(value, o.name, o.unit); };
    table.AddRow({o.name, absl::StrCat(o.readings), absl::StrCat(o.missing), shown(o.first),
                  shown(o.last), shown(o.sd_min), shown(o.sd_max)});
  }
  return text + "\n" + table.ToString();
}

void Declare(OptionList& list, ValidateOptions& options) { list.CampaignFile(options.file); }

// What a program as the model needs of a node, and what is not limited.
std::string ProgramText(const campaign::Program& program) {
  std::string command;
  for (const std::string& part : program.command) command += (command.empty() ? "" : " ") + part;
  std::string text = report::Wrapped(
      absl::StrCat(
          "The model is a program: ", command, ", with ", program.files.size(),
          " file(s). Workers run it that were started with --allow-command ",
          program.command.front().find('/') == std::string::npos ? program.command.front() : "'*'",
          "; `calibctl simulate` is the dry run."),
      "  ", "  ");
  if (!program.limits.wall && !program.limits.silence) {
    text += report::Wrapped(
        "No time is limited: a run that hangs keeps its slot until somebody stops it; write "
        "model.limits: {silence: 20 min}.",
        "! ", "  ");
  }
  return text;
}

// Of what the file says of a program what nothing acts on, so that nobody counts on it.
std::vector<std::string> NotActedOn(const campaign::Program& program) {
  std::vector<std::string> sentences;
  if (program.checkpoint) {
    sentences.emplace_back(
        "model.checkpoint: no checkpoint is asked for; a run that is tried again begins anew.");
  }
  return sentences;
}

absl::StatusOr<int> Validate(const CommonOptions& common, const ValidateOptions& options) {
  const auto source = ReadSourceFiles(options.file, std::nullopt, common.json);
  if (!source) return kBadInput;
  const campaign::Campaign& campaign = source->outcome.campaign;
  std::vector<std::string> notes = campaign::SpecimenNotes(campaign);
  for (std::string& note : campaign::ParameterNotes(campaign)) notes.push_back(std::move(note));
  if (campaign.program) {
    for (std::string& note : NotActedOn(*campaign.program)) notes.push_back(std::move(note));
  }
  std::vector<campaign::ExperimentSummary> summaries;
  summaries.reserve(campaign.experiments.size());
  for (const campaign::Experiment& experiment : campaign.experiments) {
    summaries.push_back(campaign::SummaryOf(experiment));
  }
  if (common.json) {
    std::cout << report::ProblemsJson({}, source->outcome.warnings, notes, summaries,
                                      campaign::CalibratableIn(source->yaml, campaign));
    return kDone;
  }
  std::size_t readings = 0;
  for (const campaign::ExperimentSummary& summary : summaries) {
    for (const auto& observable : summary.observables) {
      readings += static_cast<std::size_t>(observable.readings);
    }
  }
  std::cout << options.file << " is good: " << campaign.parameters.size() << " parameters, "
            << campaign.experiments.size() << " experiment(s), " << readings
            << " measured numbers, ";
  if (campaign::RunsRowsOnly(campaign)) {
    std::cout << (campaign.table ? campaign.table->like.size() : 0) << " row(s) to run.\n";
  } else if (campaign.precomputed) {
    const auto with = campaign.precomputed->with_effects.parameters.rows();
    std::cout << campaign.samples << " runs made elsewhere";
    if (with > 0) std::cout << ", and " << with << " with effects, for diagnose";
    std::cout << ".\n";
  } else {
    std::cout << campaign.method->RunsInWords(campaign) << ".\n";
  }
  if (campaign.program) std::cout << ProgramText(*campaign.program);
  for (const std::string& note : notes) std::cout << report::Wrapped(note, "  ", "  ");
  for (const campaign::Warning& warning : source->outcome.warnings) {
    std::cout << report::Wrapped(campaign::Sentence(warning), "! ", "  ");
  }
  for (const campaign::ExperimentSummary& summary : summaries) std::cout << Shown(summary);
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
