// calibctl: submit, watch, inspect, compare, report.
#include "server/ctl/command_line.h"

int main(int argc, char** argv) {
  const calib::ctl::Parsed parsed = calib::ctl::ParseCommandLine(argc, argv);
  return parsed.command ? parsed.command->verb(parsed.command->arguments) : parsed.exit_code;
}
