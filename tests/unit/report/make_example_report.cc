// Writes the report of the example campaign, for the browser test and for the eye:
// make_example_report FILE.html [NAME]
#include <fstream>
#include <iostream>
#include <string>
#include <string_view>

#include "absl/strings/escaping.h"
#include "proto/rpc/digest.h"
#include "server/page/bundle.h"
#include "server/report/documents/json_documents.h"
#include "server/report/documents/record.h"
#include "server/report/documents/report_page.h"
#include "server/report/views/sensitivity.h"
#include "tests/unit/report/example_diagnosis.h"
#include "tests/unit/report/example_view.h"

namespace {

namespace report = calib::report;

std::string_view Bundled(std::string_view name) {
  for (const calib::page::BundledFile& file : calib::page::Bundle()) {
    if (file.name == name) return file.content;
  }
  return {};
}

report::DocumentsByPath Documents(const report::CampaignView& view) {
  const auto predictions = report::PredictReadings(view);
  const std::string& id = view.status.campaign();
  const std::string here = "campaigns/" + id;
  report::DocumentsByPath documents = {
      {here, report::ShownJson({.status = view.status})},
      {here + "/compare", report::ComparisonJson(id, report::Compare(view, predictions),
                                                 report::Curves(view, predictions))},
      {here + "/posterior",
       report::PosteriorJson(
           view.posterior, view.campaign.parameters,
           report::ShapeOf(view.posterior, view.campaign.parameters, view.samples))},
      {here + "/diagnosis", report::testing::ExampleDiagnosis(view)},
      {here + "/record", report::RecordJson(view)}};
  if (const auto sensitivity = report::AnalyseCampaign(view); sensitivity.ok()) {
    documents[here + "/sensitivity"] = report::SensitivityJson(id, *sensitivity);
  }
  return documents;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::cerr << "usage: make_example_report FILE.html [NAME]\n";
    return 2;
  }
  const std::string name = argc > 2 ? argv[2] : "toyoura-0.2MPa";
  auto view = report::testing::ExampleView(name);
  view.status.set_name(name);
  const std::string_view script = Bundled("page.js");
  const std::string hash = absl::HexStringToBytes(calib::rpc::Sha256Hex(script));
  std::ofstream file(argv[1]);
  file << report::ReportPage(
      view.status.campaign(), name, Documents(view),
      {.style = Bundled("page.css"), .script = script, .script_hash = absl::Base64Escape(hash)});
  return file.good() ? 0 : 1;
}
