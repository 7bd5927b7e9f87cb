// calibctl: submit, watch, inspect, compare, report.
#include <cstdlib>
#include <iostream>

#include "proto/rpc/set_up_process.h"
#include "server/ctl/command_line.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verb_list.h"

namespace {

int Run(const calib::ctl::Command& command) {
  const absl::StatusOr<int> code = command.verb.run(command.common);
  return code.ok() ? *code : calib::ctl::Fail(code.status());
}

}  // namespace

int main(int argc, char** argv) {
  calib::rpc::SetUpProcess();
  const auto parsed = calib::ctl::ParseCommandLine(calib::ctl::AllVerbs(), argc, argv);
  const int code = parsed.command ? Run(*parsed.command) : parsed.exit_code;
  std::cout.flush();
  if (std::cout.good() || code != calib::ctl::kDone) return code;
  std::cerr << "calibctl: the answer could not be written in full to standard output\n";
  return calib::ctl::kFailed;
}
