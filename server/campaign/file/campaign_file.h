#pragma once
// The campaign file (YAML) and the data, packing, mesh and table files it names -> Campaign, or
// everything that is wrong.

#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/campaign/checks/warning.h"
#include "server/campaign/file/text/problem_list.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Content of a file named in the campaign file, by the path as written there. NOT_FOUND when there
/// is none. On the user's machine it reads the disk (DiskReader); in the server it reads stored
/// blobs.
using FileReader = std::function<absl::StatusOr<std::string>(const std::string& path)>;

/// What a sheet of a workbook is called where files are called by their paths: "t.xlsx[Data]";
/// the path itself where no sheet is named, or the path is of no workbook.
std::string SheetPath(const std::string& path, const std::string& sheet);

/// Reader for paths relative to the folder of the campaign file; expands $CALIB_DATA. Of a workbook
/// it gives a sheet as text (file/text/workbook.h), so that none travels to a server.
FileReader DiskReader(const std::string& campaign_file_path);

struct ReadOutcome {
  Campaign campaign;              ///< meaningful only when problems is empty
  std::vector<Problem> problems;  ///< in order of file and line
  /// What is odd about a new campaign that has no problems, and about its files.
  std::vector<Warning> warnings;
  std::vector<std::string> files;  ///< paths the campaign names, as written, that could be read
};

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

/// Parses and validates everything `submit` checks. Never throws; reads files only through
/// `reader`.
ReadOutcome ReadCampaign(const std::string& yaml_text, const std::string& file_name,
                         const FileReader& reader,
                         std::optional<std::uint64_t> seed_override = std::nullopt,
                         CampaignIs is = CampaignIs::kNew, const ReadLimits& limits = {});

}  // namespace calib::campaign
