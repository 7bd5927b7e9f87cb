#include "worker/program/run_limits.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "fmt/format.h"
#include "worker/program/json_text.h"

namespace calib::worker {

std::string SizeInWords(double bytes) { return fmt::format("{:.4g} MB", 1e-6 * bytes); }

std::string RunLimits::AtMemory(double resident) {
  const bool is_above = limits_.has_memory() && resident > limits_.memory();
  if (!std::exchange(was_above_, is_above) || !is_above) return "";
  return absl::StrCat("came to its memory limit: ", SizeInWords(resident), " of ",
                      SizeInWords(limits_.memory()));
}

std::string RunLimits::AtTime(Clock::time_point now) const {
  const auto since = [now](Clock::time_point then) {
    return std::chrono::duration<double>(now - then).count();
  };
  if (limits_.has_wall() && since(begin_) > limits_.wall()) {
    return absl::StrCat("came to its wall limit of ", NumberText(limits_.wall()), " s");
  }
  if (limits_.has_silence() && since(last_state_) > limits_.silence()) {
    return absl::StrCat("came to its silence limit: no state for ", NumberText(limits_.silence()),
                        " s");
  }
  return "";
}

}  // namespace calib::worker
