#pragma once
// How a campaign is read: where its files come from, by which rules, and what is too much.

#include <cstddef>
#include <functional>
#include <limits>
#include <string>

#include "absl/status/statusor.h"

namespace calib::campaign {

/// Content of a file named in the campaign file, by the path as written there. NOT_FOUND when there
/// is none. On the user's machine it reads the disk (DiskReader); in the server it reads stored
/// blobs.
/// A path that ends in '/' is answered with what lies there, of a folder all files below it, of a
/// file itself: a line each, sorted, "x " before what may be executed and "- " before the rest,
/// then its path below the folder (nothing for the file itself).
using FileReader = std::function<absl::StatusOr<std::string>(const std::string& path)>;

/// A campaign that was accepted once, maybe by an earlier build, is not asked again what only says
/// that its runs would be of no use (overlaps, holes, the budget of one iteration), and its
/// measurements are read by the rules of its time, so that what was computed from them stays true.
/// The first rules: names of columns are parted as the rows are; a first reading behind the start
/// is loading; runs made elsewhere are paired with readings by their step alone.
enum class CampaignIs { kNew, kStored, kStoredByFirstRules };

/// Number of the rules by which new campaigns are read; stored with them.
inline constexpr int kReadingRules = 2;

/// How a campaign is read that was accepted under the rules of this number.
constexpr CampaignIs StoredUnder(int reading_rules) {
  return reading_rules < kReadingRules ? CampaignIs::kStoredByFirstRules : CampaignIs::kStored;
}

/// What is refused before it is read, for what it would cost.
struct ReadLimits {
  std::size_t covariance =
      std::numeric_limits<std::size_t>::max();  ///< readings of one covariance matrix
};

}  // namespace calib::campaign
