#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/ctl/command_line.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/shell/man_pages.h"
#include "server/ctl/verb.h"
#include "server/ctl/verb_list.h"
#include "server/ctl/write_file.h"

namespace calib::ctl {
namespace {

struct ManOptions {
  std::string output;  ///< folder
};

void Declare(OptionList& list, ManOptions& options) {
  list.Text("-o,--output", options.output, "folder, created if need be").Required();
}

absl::StatusOr<int> Man(const CommonOptions& common, const ManOptions& options) {
  const std::filesystem::path folder(options.output);
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    return absl::PermissionDeniedError(
        absl::StrCat(options.output, " cannot be made: ", error.message()));
  }
  const auto pages = ManPages(DescribeCommands(AllVerbs()));
  for (const auto& [name, page] : pages) {
    RETURN_IF_ERROR(WriteFile((folder / name).string(), page));
  }
  if (common.json) {
    std::cout << nlohmann::ordered_json{{"folder", options.output}, {"pages", pages.size()}}.dump(2)
              << "\n";
  } else {
    std::cout << pages.size() << " pages; man -l " << (folder / "calibctl.1").string() << "\n";
  }
  return kDone;
}

}  // namespace

Verb ManVerb() {
  return MakeVerb<ManOptions>({.name = "man",
                               .description = "The manual: a page of all commands, one for each",
                               .example = "man -o ~/.local/share/man/man1"},
                              &Declare, &Man);
}

}  // namespace calib::ctl
