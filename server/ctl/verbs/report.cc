#include <iostream>
#include <string>

#include "calib/return_if_error.h"
#include "server/client/progress.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/report_file.h"
#include "server/ctl/verb.h"
#include "server/ctl/write_file.h"

namespace calib::ctl {
namespace {

struct ReportOptions {
  std::string campaign;
  std::string output;  ///< HTML file
};

void Declare(OptionList& list, ReportOptions& options) {
  list.Campaign(options.campaign);
  list.Text("-o,--output", options.output, "HTML file").Required();
}

absl::StatusOr<int> Report(const CommonOptions& common, const ReportOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  const auto make = [&] {
    const client::BusyLine busy("writing the report of " + options.campaign);
    return ReportFile(session->client(), options.campaign);
  };
  ASSIGN_OR_RETURN(const auto html, make());
  RETURN_IF_ERROR(WriteFile(options.output, html));
  if (common.json) {
    std::cout << "{\"campaign\": \"" << options.campaign << "\", \"written\": true}\n";
  } else {
    std::cout << "The report of " << options.campaign << " is in " << options.output << ".\n";
  }
  return kDone;
}

}  // namespace

Verb ReportVerb() {
  return MakeVerb<ReportOptions>(
      {.name = "report",
       .description = "One self-contained HTML file with the figures of the live page",
       .example = "report c1 -o c1.html --state calib-state"},
      &Declare, &Report);
}

}  // namespace calib::ctl
