#include "server/report/html/report.h"

#include <iostream>
#include <string>

#include "calib/return_if_error.h"
#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/load_story.h"
#include "server/ctl/option_list.h"
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
  ASSIGN_OR_RETURN(const auto view, client::LoadView(session->client(), options.campaign));
  ASSIGN_OR_RETURN(const auto story, LoadStory(session->client(), view));
  RETURN_IF_ERROR(WriteFile(options.output, report::RenderReport(view, story)));
  if (common.json) {
    std::cout << "{\"campaign\": \"" << view.status.campaign() << "\", \"written\": true}\n";
  } else {
    std::cout << "The report of " << view.status.campaign() << " is in " << options.output << ".\n";
  }
  return kDone;
}

}  // namespace

Verb ReportVerb() {
  return MakeVerb<ReportOptions>({.name = "report",
                                  .description = "One self-contained HTML file with plots",
                                  .example = "report c1 -o c1.html --state calib-state"},
                                 &Declare, &Report);
}

}  // namespace calib::ctl
