// Writes the report of the example campaign, for the browser test and for the eye:
// make_example_report FILE.html [NAME]
#include <fstream>
#include <iostream>

#include "server/report/html/report.h"
#include "server/report/views/stored_diagnosis.h"
#include "tests/unit/report/example_diagnosis.h"
#include "tests/unit/report/example_view.h"

int main(int argc, char** argv) {
  if (argc < 2) {
    std::cerr << "usage: make_example_report FILE.html [NAME]\n";
    return 2;
  }
  namespace report = calib::report;
  const auto view = report::testing::ExampleView(argc > 2 ? argv[2] : "toyoura-0.2MPa");
  const auto diagnosis = report::ReadDiagnosis(report::testing::ExampleDiagnosis(view));
  if (!diagnosis.ok()) return 1;
  report::Story story;
  story.known = true;
  story.diagnoses = {*diagnosis};
  std::ofstream file(argv[1]);
  file << report::RenderReport(view, story);
  return file.good() ? 0 : 1;
}
