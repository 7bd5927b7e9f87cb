// Ends the build where a field of the protos has no rule.
#include <cstdio>

#include "proto/rpc/check_message.h"

int main() {
  const auto problems = calib::rpc::ProblemsOfRules();
  for (const std::string& problem : problems) {
    std::fprintf(stderr, "%s\n", problem.c_str());
  }
  return problems.empty() ? 0 : 1;
}
