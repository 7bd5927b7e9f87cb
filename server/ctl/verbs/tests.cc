#include <iostream>

#include "server/ctl/catalog_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verb.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {
namespace {

absl::StatusOr<int> Tests(const CommonOptions& common) {
  if (common.json) {
    std::cout << report::TestsJson();
    return kDone;
  }
  for (const dem::TestInfo& test : dem::Tests()) {
    std::cout << TestText(test) << "\n";
  }
  return kDone;
}

}  // namespace

Verb TestsVerb() {
  return {
      .help = {.name = "tests", .description = "Lab tests this build offers", .example = "tests"},
      .run = &Tests};
}

}  // namespace calib::ctl
