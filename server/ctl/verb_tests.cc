#include <iostream>

#include "server/ctl/catalog_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verbs.h"
#include "server/report/json_documents.h"

namespace calib::ctl {

int Tests(const Arguments& arguments) {
  if (arguments.json) {
    std::cout << report::TestsJson();
    return kDone;
  }
  for (const dem::TestInfo& test : dem::Tests()) {
    std::cout << test.name << " (control: " << test.control
              << (test.may_reverse ? "" : ", one way only") << ")\n  " << test.description
              << "\n  observables:";
    for (const std::string& observable : test.observables) std::cout << " " << observable;
    std::cout << "\n";
    for (const dem::MeshInfo& mesh : test.meshes) {
      std::cout << "  mesh " << mesh.name << ": " << mesh.description << "\n";
    }
    std::cout << ParameterTable(test.settings) << "\n";
  }
  return kDone;
}

}  // namespace calib::ctl
