#include <filesystem>
#include <iostream>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/report_file.h"
#include "server/ctl/verb.h"
#include "server/ctl/write_file.h"
#include "server/messages/read_words.h"
#include "server/report/documents/csv_export.h"
#include "server/report/documents/json_documents.h"
#include "server/report/documents/record.h"

namespace calib::ctl {
namespace {

struct ExportOptions {
  std::string campaign;
  std::string output;  ///< folder
};

// As it was run: with the seed of the command line, where one was given.
std::string CampaignFile(const v1::CampaignSource& source) {
  campaign::YamlParse parse = campaign::ParseYaml(source.campaign_file());
  if (!source.has_seed() || !parse.root) return source.campaign_file();
  campaign::YamlAt(*parse.root, "seed") = campaign::YamlScalar(absl::StrCat(source.seed()));
  return campaign::ToYaml(*parse.root);
}

std::vector<std::pair<std::string, std::string>> Files(const report::CampaignView& view) {
  const auto predictions = report::PredictReadings(view);
  const std::string& id = view.status.campaign();
  return {{"campaign.yaml", CampaignFile(view.source)},
          {"status.json", report::StatusJson(view.status)},
          {"posterior.json",
           view.status.infers_nothing()
               ? report::TablePosteriorJson(view.status)
               : report::PosteriorJson(
                     view.posterior, view.campaign.parameters,
                     report::ShapeOf(view.posterior, view.campaign.parameters, view.samples))},
          {"posterior.csv", report::PosteriorCsv(view.posterior)},
          {"samples.json", report::SamplesJson(id, view.campaign.parameters, view.samples)},
          {"samples.csv", report::SamplesCsv(view)},
          {"states.csv", report::StatesCsv(view)},
          {"data.json", report::DataJson(view.campaign)},
          {"fit.csv", report::FitCsv(view, predictions)},
          {"compare.json", report::ComparisonJson(id, report::Compare(view, predictions),
                                                  report::Curves(view, predictions))},
          {"record.json", report::RecordJson(view)},
          {"posterior.tex", report::LatexTable(view)}};
}

void Declare(OptionList& list, ExportOptions& options) {
  list.Campaign(options.campaign);
  list.Text("-o,--output", options.output, "folder, created if need be").Required();
}

absl::StatusOr<int> Export(const CommonOptions& common, const ExportOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  ASSIGN_OR_RETURN(const auto view, client::LoadView(session->client(), options.campaign));
  const std::filesystem::path folder(options.output);
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    return absl::PermissionDeniedError(options.output + " cannot be made: " + error.message());
  }
  auto files = Files(view);
  if (CanReport()) {
    ASSIGN_OR_RETURN(auto html, ReportFile(session->client(), options.campaign));
    files.emplace_back("report.html", std::move(html));
  }
  for (const auto& [name, content] : files) {
    RETURN_IF_ERROR(WriteFile((folder / name).string(), content));
  }
  if (common.json) {
    std::cout << "{\"campaign\": \"" << view.status.campaign() << "\", \"files\": " << files.size()
              << "}\n";
  } else {
    for (const auto& [name, content] : files) std::cout << (folder / name).string() << "\n";
  }
  return kDone;
}

}  // namespace

Verb ExportVerb() {
  return MakeVerb<ExportOptions>({.name = "export",
                                  .description = "CSV and JSON of everything",
                                  .example = "export c1 -o c1 --state calib-state"},
                                 &Declare, &Export);
}

}  // namespace calib::ctl
