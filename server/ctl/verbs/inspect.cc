#include <algorithm>
#include <iostream>
#include <string>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/file/campaign_file.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/inspection_text.h"
#include "server/ctl/option_list.h"
#include "server/ctl/terminal.h"
#include "server/ctl/verb.h"
#include "server/ctl/write_file.h"
#include "server/inspection/campaign_draft.h"
#include "server/inspection/inspect_file.h"
#include "server/inspection/inspection_json.h"
#include "server/methods/registry.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

struct InspectOptions {
  std::vector<std::string> files;
  std::vector<std::string> meanings;
  std::string campaign, test, sheet;
};

void Declare(OptionList& list, InspectOptions& options) {
  list.Texts("FILE", options.files, "tables of laboratories, as text or .xlsx").Required();
  list.Texts("--meaning", options.meanings,
             "COLUMN=NAME: what a column is; =-NAME turns its sign, =NAME[unit] says its unit, "
             "=nothing leaves it out");
  list.Text("--campaign", options.campaign, "write a campaign that calibrates to these files");
  list.Text("--test", options.test, "with --campaign: lab test that reproduces them");
  list.Text("--sheet", options.sheet, "of a workbook, where more than one holds numbers");
}

std::vector<inspection::InspectedFile> InspectAll(
    const InspectOptions& options, const std::vector<inspection::SaidMeaning>& said) {
  std::vector<inspection::InspectedFile> files;
  files.reserve(options.files.size());
  for (const std::string& file : options.files) {
    files.push_back(inspection::InspectFile(file, options.sheet, said));
  }
  return files;
}

// A meaning of a column that no file has is a slip of the pen.
bool SaidOfColumns(const std::vector<inspection::SaidMeaning>& said,
                   const std::vector<inspection::InspectedFile>& files) {
  for (const inspection::SaidMeaning& one : said) {
    std::vector<std::string> names;
    for (const inspection::InspectedFile& file : files) {
      for (const inspection::ColumnMeaning& column : file.inspection.columns) {
        names.push_back(column.name);
        names.push_back(column.header);
      }
    }
    if (std::find(names.begin(), names.end(), one.column) != names.end() || names.empty()) continue;
    std::cerr << "calibctl: --meaning speaks of a column " << campaign::Quoted(one.column)
              << ", which no file has; " << campaign::Suggestion(one.column, names) << "\n";
    return false;
  }
  return true;
}

// The open questions of all files, one at a time, until there is none. False: no answer came.
bool Ask(const InspectOptions& options, std::vector<inspection::SaidMeaning>& said,
         std::vector<inspection::InspectedFile>& files) {
  while (true) {
    const inspection::ColumnMeaning* open = nullptr;
    for (const inspection::InspectedFile& file : files) {
      for (const inspection::ColumnMeaning& column : file.inspection.columns) {
        if (open == nullptr && column.open) open = &column;
      }
    }
    if (open == nullptr) return true;
    std::cerr << "What is column " << campaign::Quoted(open->name) << "?\n";
    std::vector<std::string> choices = open->options;
    if (std::find(choices.begin(), choices.end(), "nothing") == choices.end()) {
      choices.emplace_back("nothing");
    }
    for (std::size_t i = 0; i < choices.size(); ++i) {
      std::cerr << "  " << i + 1 << "  " << choices[i] << "\n";
    }
    std::cerr << "number or NAME[unit]: ";
    std::string answer;
    if (!std::getline(std::cin, answer)) return false;
    std::size_t number = 0;
    if (absl::SimpleAtoi(answer, &number) && number >= 1 && number <= choices.size()) {
      answer = choices[number - 1];
    }
    std::string problem;
    const auto meaning =
        inspection::ReadSaidMeaning(absl::StrCat(open->name, "=", answer), problem);
    if (!meaning) {
      std::cerr << problem << "\n";
      continue;
    }
    said.push_back(*meaning);
    files = InspectAll(options, said);
  }
}

bool AnyOpen(const std::vector<inspection::InspectedFile>& files) {
  bool open = false;
  for (const inspection::InspectedFile& file : files) {
    for (const inspection::Finding& finding : file.inspection.findings) {
      if (finding.kind != inspection::FindingKind::kAmbiguous) continue;
      open = true;
      std::cerr << report::Wrapped(absl::StrCat(file.file, ": ambiguous: ", finding.text), "",
                                   "  ");
    }
  }
  return open;
}

absl::StatusOr<int> WriteCampaign(const CommonOptions& common, const InspectOptions& options,
                                  const std::vector<inspection::InspectedFile>& files) {
  if (AnyOpen(files)) {
    std::cerr << "Nothing was written.\n";
    return kBadInput;
  }
  ASSIGN_OR_RETURN(const std::string text,
                   inspection::CampaignDraft(files, {.test = options.test,
                                                     .campaign_file = options.campaign,
                                                     .sheet = options.sheet}));
  const campaign::ReadOutcome outcome = campaign::ReadCampaign(
      methods::All(), text, options.campaign, campaign::DiskReader(options.campaign));
  for (const campaign::Problem& problem : outcome.problems) {
    std::cerr << campaign::ToString(problem) << "\n";
  }
  if (!outcome.problems.empty()) {
    std::cerr << "Nothing was written: the campaign would not be valid.\n";
    return kBadInput;
  }
  ASSIGN_OR_RETURN(auto file, OutputFile::Open(options.campaign));
  RETURN_IF_ERROR(file.Put(text));
  if (common.json) return kDone;
  for (const campaign::Warning& warning : outcome.warnings) {
    std::cout << report::Wrapped(campaign::Sentence(warning), "! ", "  ");
  }
  std::cout << "\n"
            << options.campaign << " is written. See to what is marked \"confirm\", then:\n"
            << "  calibctl validate " << options.campaign << "\n  calibctl run " << options.campaign
            << "\n";
  return kDone;
}

absl::StatusOr<int> Inspect(const CommonOptions& common, const InspectOptions& options) {
  std::vector<inspection::SaidMeaning> said;
  for (const std::string& text : options.meanings) {
    std::string problem;
    const auto meaning = inspection::ReadSaidMeaning(text, problem);
    if (!meaning) {
      std::cerr << "calibctl: --meaning: " << problem << "\n";
      return kBadInput;
    }
    said.push_back(*meaning);
  }
  if (options.campaign.empty() != options.test.empty()) {
    std::cerr << "calibctl: --campaign OUT.yaml and --test TEST go together\n";
    return kBadInput;
  }
  auto files = InspectAll(options, said);
  if (!SaidOfColumns(said, files)) return kBadInput;
  bool sound = true;
  for (const inspection::InspectedFile& file : files) {
    for (const campaign::TableProblem& problem : file.problems) {
      sound = false;
      std::cerr << campaign::ToString({file.file, problem.line, problem.column, problem.message})
                << "\n";
    }
  }
  const bool writes = sound && !options.campaign.empty();
  if (writes && !common.json && CanAsk() && !Ask(options, said, files)) return kBadInput;
  if (common.json) {
    std::cout << inspection::InspectionJson(files);
  } else {
    const report::TerminalStyle style = ThisTerminal();
    bool first = true;
    for (const inspection::InspectedFile& file : files) {
      if (!file.problems.empty()) continue;
      if (!first) std::cout << "\n";
      first = false;
      std::cout << InspectionText(file.inspection, style);
    }
  }
  if (writes) return WriteCampaign(common, options, files);
  return sound ? kDone : kBadInput;
}

}  // namespace

Verb InspectVerb() {
  return MakeVerb<InspectOptions>(
      {.name = "inspect",
       .description = "What a laboratory's file holds, what is odd in it, and a campaign from it",
       .example = "inspect tx200.csv --campaign sand.yaml --test triaxial_drained"},
      &Declare, &Inspect);
}

}  // namespace calib::ctl
