#include "server/report/html/report.h"

#include <iostream>

#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/load_story.h"
#include "server/ctl/verbs.h"
#include "server/ctl/write_file.h"

namespace calib::ctl {

int Report(const Arguments& arguments) {
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  const auto view = client::LoadView((*session)->client(), arguments.campaign);
  if (!view.ok()) return Fail(view.status());
  const auto story = LoadStory((*session)->client(), *view);
  if (!story.ok()) return Fail(story.status());
  if (auto written = WriteFile(arguments.output, report::RenderReport(*view, *story));
      !written.ok()) {
    return Fail(written);
  }
  if (arguments.json) {
    std::cout << "{\"campaign\": \"" << view->status.campaign() << "\", \"written\": true}\n";
  } else {
    std::cout << "The report of " << view->status.campaign() << " is in " << arguments.output
              << ".\n";
  }
  return kDone;
}

}  // namespace calib::ctl
