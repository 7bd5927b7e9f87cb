#pragma once
// An improvement as it was kept at the server: the JSON document of `calibctl improve`, read back
// for people.

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace calib::report {

/// A model on the way.
struct ImprovedModel {
  std::string campaign{};
  std::string verdict{};  ///< adequate | missing_effect | ambiguous | unexplained
  std::string reason{};   ///< for the next effect, or for none, and what spoke against others
  std::optional<double> left_out_error{};  ///< none in older records
};

struct StoredImprovement {
  std::vector<ImprovedModel> steps{};        ///< base first
  std::string verdict_digest{};              ///< SHA-256, kept before the held-out data were opened
  std::vector<std::string> opened_before{};  ///< digests of other verdicts they were opened for
};

/// INVALID_ARGUMENT when the text is no such document; fields of other versions are left out.
absl::StatusOr<StoredImprovement> ReadImprovement(const std::string& json);

}  // namespace calib::report
