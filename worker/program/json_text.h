#pragma once
// One JSON object, as programs print it; numbers keep their bits. Pure.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace calib::worker {

/// A member of an object. What stands inside of an array or an object is read and dropped.
struct JsonMember {
  enum class Kind { kNumber, kText, kTrue, kFalse, kNull, kInside };
  std::string name{};
  Kind kind = Kind::kNull;
  double number = 0;   ///< of kNumber; correctly rounded, NaN and infinity where it says so
  std::string text{};  ///< of kText, escapes replaced
};

/// Members in the order in which they stand; a name may stand twice. JSON as RFC 8259 has it, with
/// NaN, Infinity and -Infinity as Python writes them; a number beyond the doubles is infinite.
/// INVALID_ARGUMENT: what is wrong and at which column (from 1); arrays in arrays end at 200.
absl::StatusOr<std::vector<JsonMember>> ReadJsonObject(std::string_view text);

/// A decimal number, the whole of `text`, correctly rounded; also "1." and ".5", no sign "+".
/// Beyond the doubles: infinite, or zero. Empty: it is none (NaN and inf are not).
std::optional<double> ReadDecimal(std::string_view text);

/// The shortest text that is read back to the same bits; whole numbers below 1e15 are written
/// without an exponent. value is finite.
std::string NumberText(double value);

/// A JSON text with its quotes. Bytes that are no control characters stay as they are.
std::string QuotedJson(std::string_view text);

}  // namespace calib::worker
