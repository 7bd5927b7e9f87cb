#include "server/inspection/inspect_file.h"

#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/campaign_file.h"

namespace calib::inspection {

InspectedFile InspectFile(const std::string& file, const std::string& sheet,
                          const std::vector<SaidMeaning>& said) {
  InspectedFile answer{.file = file};
  std::error_code error;
  const auto size = std::filesystem::file_size(file, error);
  if (!error && size > kLargestFile) {
    answer.problems.push_back(
        {0, "",
         absl::StrCat("has ", size >> 20, " MB; a table of readings of at most ",
                      kLargestFile >> 20, " MB is read")});
    return answer;
  }
  const auto bytes = campaign::DiskReader("")(campaign::SheetPath(file, sheet));
  if (!bytes.ok()) {
    answer.problems.push_back({0, "", absl::StrCat("cannot be read: ", bytes.status().message())});
    return answer;
  }
  answer.inspection = Inspect(file, *bytes, said, answer.problems);
  return answer;
}

}  // namespace calib::inspection
