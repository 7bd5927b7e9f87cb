#pragma once
// What the protos say of each field, held against a message that has come in.

#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace calib::rpc {

/// INVALID_ARGUMENT with one sentence on the first field, in the order of the protos, that breaks
/// its rule (calib/v1/rules.proto): its path, what it holds, what it may hold. Rules of fields that
/// are not set are not asked, but for `required`. A value of an enum that is not known here is
/// refused. Messages of calib.v1 only. Thread-safe.
absl::Status CheckMessage(const google::protobuf::Message& message);

/// Sentences on fields of calib.v1 that need a rule and have none, and on rules that say nothing to
/// their field; empty where all is well. The build ends with them (check_rules_main.cc).
std::vector<std::string> ProblemsOfRules();

}  // namespace calib::rpc
