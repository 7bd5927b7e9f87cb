#pragma once
// The campaign file (YAML) and the data, packing, mesh and table files it names -> Campaign, or
// everything that is wrong.

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/campaign/checks/warning.h"
#include "server/campaign/file/shared/reading.h"
#include "server/campaign/file/text/problem_list.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

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

/// Parses and validates everything `submit` checks. Never throws; reads files only through
/// `reader`. The campaign's method is one of `methods`.
ReadOutcome ReadCampaign(const MethodList& methods, const std::string& yaml_text,
                         const std::string& file_name, const FileReader& reader,
                         std::optional<std::uint64_t> seed_override = std::nullopt,
                         CampaignIs is = CampaignIs::kNew, const ReadLimits& limits = {});

}  // namespace calib::campaign
