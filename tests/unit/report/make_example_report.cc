// Writes the report of the example campaign, for the browser test and for the eye:
// make_example_report FILE.html [NAME]
#include <fstream>
#include <iostream>

#include "server/report/html/report.h"
#include "tests/unit/report/example_view.h"

int main(int argc, char** argv) {
  if (argc < 2) {
    std::cerr << "usage: make_example_report FILE.html [NAME]\n";
    return 2;
  }
  std::ofstream file(argv[1]);
  file << calib::report::RenderReport(
      calib::report::testing::ExampleView(argc > 2 ? argv[2] : "toyoura-0.2MPa"));
  return file.good() ? 0 : 1;
}
