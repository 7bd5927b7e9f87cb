#pragma once
// What an inspection has to say of a file.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "server/campaign/model/word_table.h"

namespace calib::inspection {

enum class FindingKind {
  kDecimalMark,
  kUnits,
  kSign,
  kOffset,
  kDuplicateControl,
  kPause,
  kUnloading,
  kPlateau,
  kStressPath,
  kVoidRatio,
  kMissing,
  kEncoding,
  kAmbiguous,  ///< two readings are possible, and a campaign is written only once it is said which
};
inline constexpr std::array kFindingWords = {
    campaign::Word{FindingKind::kDecimalMark, "decimal_mark"},
    campaign::Word{FindingKind::kUnits, "units"},
    campaign::Word{FindingKind::kSign, "sign"},
    campaign::Word{FindingKind::kOffset, "offset"},
    campaign::Word{FindingKind::kDuplicateControl, "duplicate_control"},
    campaign::Word{FindingKind::kPause, "pause"},
    campaign::Word{FindingKind::kUnloading, "unloading"},
    campaign::Word{FindingKind::kPlateau, "plateau"},
    campaign::Word{FindingKind::kStressPath, "stress_path"},
    campaign::Word{FindingKind::kVoidRatio, "void_ratio"},
    campaign::Word{FindingKind::kMissing, "missing"},
    campaign::Word{FindingKind::kEncoding, "encoding"},
    campaign::Word{FindingKind::kAmbiguous, "ambiguous"},
};

struct Finding {
  FindingKind kind = FindingKind::kUnits;
  bool odd = false;           ///< contradicts the file itself or physics; otherwise a note
  std::optional<int> line{};  ///< of the file, from 1
  std::string text{};         ///< a sentence
};

}  // namespace calib::inspection
