#include <iostream>

#include "server/ctl/catalog_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verbs.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {

int Tests(const Arguments& arguments) {
  if (arguments.json) {
    std::cout << report::TestsJson();
    return kDone;
  }
  for (const dem::TestInfo& test : dem::Tests()) {
    std::cout << TestText(test) << "\n";
  }
  return kDone;
}

}  // namespace calib::ctl
