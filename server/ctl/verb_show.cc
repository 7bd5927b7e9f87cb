#include <fmt/format.h>

#include <ctime>
#include <iostream>

#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/session.h"
#include "server/ctl/verbs.h"
#include "server/report/json_documents.h"

namespace calib::ctl {
namespace {

std::string Clock(std::int64_t unix_ms) {
  const std::time_t seconds = unix_ms / 1000;
  std::tm local{};
  localtime_r(&seconds, &local);
  return fmt::format("{:04}-{:02}-{:02} {:02}:{:02}:{:02}", local.tm_year + 1900, local.tm_mon + 1,
                     local.tm_mday, local.tm_hour, local.tm_min, local.tm_sec);
}

}  // namespace

int Show(const Arguments& arguments) {
  const auto session = Session::Open(arguments);
  if (!session.ok()) return Fail(session.status());
  Client& client = (*session)->client();
  const auto status = client.Show(arguments.campaign);
  if (!status.ok()) return Fail(status.status());
  if (arguments.json) {
    std::cout << report::StatusJson(*status);
    return kDone;
  }
  std::cout << StatusText(*status);
  const auto log = client.GetLog(arguments.campaign);
  if (!log.ok()) return Fail(log.status());
  constexpr std::size_t kShown = 10;
  const std::size_t first = log->size() > kShown ? log->size() - kShown : 0;
  for (std::size_t i = first; i < log->size(); ++i) {
    std::cout << Clock((*log)[i].unix_ms()) << "  " << (*log)[i].what() << "\n";
  }
  return kDone;
}

}  // namespace calib::ctl
