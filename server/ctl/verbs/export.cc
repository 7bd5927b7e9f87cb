#include <filesystem>
#include <iostream>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verbs.h"
#include "server/ctl/write_file.h"
#include "server/report/documents/csv_export.h"
#include "server/report/documents/json_documents.h"
#include "server/report/html/report.h"

namespace calib::ctl {
namespace {

// As it was run: with the seed of the command line, where one was given.
std::string CampaignFile(const v1::CampaignSource& source) {
  campaign::YamlParse parse = campaign::ParseYaml(source.campaign_file());
  if (!source.has_seed() || !parse.root) return source.campaign_file();
  campaign::YamlAt(*parse.root, "seed") = campaign::YamlScalar(absl::StrCat(source.seed()));
  return campaign::ToYaml(*parse.root);
}

std::vector<std::pair<std::string, std::string>> Files(const report::CampaignView& view) {
  const auto predictions = report::PredictReadings(view);
  std::vector<std::string> names;
  for (const campaign::CalibratedParameter& parameter : view.campaign.parameters) {
    names.push_back(parameter.name);
  }
  const std::string& id = view.status.campaign();
  return {{"campaign.yaml", CampaignFile(view.source)},
          {"status.json", report::StatusJson(view.status)},
          {"posterior.json", view.status.method() == "table"
                                 ? report::TablePosteriorJson(view.status)
                                 : report::PosteriorJson(view.posterior, view.campaign.parameters)},
          {"posterior.csv", report::PosteriorCsv(view.posterior)},
          {"samples.json", report::SamplesJson(id, names, view.samples)},
          {"samples.csv", report::SamplesCsv(view)},
          {"states.csv", report::StatesCsv(view)},
          {"data.json", report::DataJson(view.campaign)},
          {"fit.csv", report::FitCsv(view, predictions)},
          {"compare.json", report::ComparisonJson(id, report::Compare(view, predictions))},
          {"report.html", report::RenderReport(view)}};
}

}  // namespace

int Export(const Arguments& arguments) {
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  const auto view = client::LoadView((*session)->client(), arguments.campaign);
  if (!view.ok()) return Fail(view.status());
  const std::filesystem::path folder(arguments.output);
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    return Fail(
        absl::PermissionDeniedError(arguments.output + " cannot be made: " + error.message()));
  }
  const auto files = Files(*view);
  for (const auto& [name, content] : files) {
    if (auto written = WriteFile((folder / name).string(), content); !written.ok()) {
      return Fail(written);
    }
  }
  if (arguments.json) {
    std::cout << "{\"campaign\": \"" << view->status.campaign() << "\", \"files\": " << files.size()
              << "}\n";
  } else {
    for (const auto& [name, content] : files) std::cout << (folder / name).string() << "\n";
  }
  return kDone;
}

}  // namespace calib::ctl
