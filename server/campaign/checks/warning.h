#pragma once
// What is odd about a campaign that can be run all the same: said, never refused.

#include <array>
#include <string>
#include <vector>

#include "server/campaign/model/word_table.h"

namespace calib::campaign {

enum class WarningKind {
  kUnit,       ///< a reading contradicts the test's start by a factor, or its column's heading
  kSign,       ///< a strain and what resists it go opposite ways
  kOffset,     ///< a first reading is off where the test begins
  kPathOrder,  ///< the rows are hardly in the order in which they were measured
  kErrorSize,  ///< an error, or its correlation length, is beyond the range of its readings
  kRedundant,  ///< an observable follows from others that are compared too
  kUnmoved,    ///< no reading depends on the parameters
  kFewGrains,  ///< too few grains for what the test reads
  kScatter,    ///< the readings scatter otherwise than their stated noise says
  kRepeated,   ///< runs made elsewhere repeat the parameters of others
  kLabels,     ///< labels of experiments from which nothing is learnt
};
inline constexpr std::array kWarningKindWords = {
    Word{WarningKind::kUnit, "unit"},
    Word{WarningKind::kSign, "sign"},
    Word{WarningKind::kOffset, "offset"},
    Word{WarningKind::kPathOrder, "path_order"},
    Word{WarningKind::kErrorSize, "error_size"},
    Word{WarningKind::kRedundant, "redundant"},
    Word{WarningKind::kUnmoved, "unmoved"},
    Word{WarningKind::kFewGrains, "few_grains"},
    Word{WarningKind::kScatter, "scatter"},
    Word{WarningKind::kRepeated, "repeated"},
    Word{WarningKind::kLabels, "labels"},
};

struct Warning {
  WarningKind kind = WarningKind::kUnit;
  std::string experiment;  ///< empty: the campaign as a whole
  std::string name;        ///< of the observable or the control; empty: the whole
  std::string message;     ///< a sentence, without the two
};

/// "tx, stress_ratio: begins at 0.01, ..."
std::string Sentence(const Warning& warning);
std::vector<std::string> Sentences(const std::vector<Warning>& warnings);

}  // namespace calib::campaign
