// calibctl: submit, watch, inspect, compare, report.
#include <iostream>

#include "server/ctl/command_line.h"
#include "server/ctl/exit_codes.h"

int main(int argc, char** argv) {
  const calib::ctl::Parsed parsed = calib::ctl::ParseCommandLine(argc, argv);
  const int code =
      parsed.command ? parsed.command->verb(parsed.command->arguments) : parsed.exit_code;
  std::cout.flush();
  if (std::cout.good() || code != calib::ctl::kDone) return code;
  std::cerr << "calibctl: the answer could not be written in full to standard output\n";
  return calib::ctl::kFailed;
}
