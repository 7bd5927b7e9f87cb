// Files of a user's program that stay with a sample: their names, and a copy of each.
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/ctl/write_file.h"

namespace calib::ctl {
namespace {

namespace fs = std::filesystem;

struct KeptOptions {
  std::string campaign;
  int sample = 0;
  std::string output{};  ///< folder; empty: names alone
};

void Declare(OptionList& list, KeptOptions& options) {
  list.Campaign(options.campaign);
  list.WholeNumber("SAMPLE", options.sample, "index, as shown by `calibctl samples`").Required();
  list.Text("-o,--output", options.output,
            "folder for copies, created if need be; one below it per experiment [names alone]");
}

// A name comes from a worker: it leads nowhere else.
bool StaysBelow(const std::string& name) {
  const fs::path path = fs::path(name).lexically_normal();
  return !path.empty() && path.is_relative() && *path.begin() != ".." && path.has_filename();
}

absl::StatusOr<std::string> Copy(client::Client& client, const v1::KeptFile& file,
                                 const fs::path& folder) {
  if (!StaysBelow(file.name())) {
    return absl::DataLossError(absl::StrCat(file.name(), " leads out of the folder"));
  }
  ASSIGN_OR_RETURN(const std::string content, client.GetBlob(file.digest()));
  const fs::path path = folder / file.name();
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  if (error) {
    return absl::PermissionDeniedError(
        absl::StrCat(path.parent_path().string(), ": ", error.message()));
  }
  RETURN_IF_ERROR(WriteFile(path.string(), content));
  return path.string();
}

absl::StatusOr<v1::Sample> SampleOf(client::Client& client, const KeptOptions& options) {
  ASSIGN_OR_RETURN(auto samples, client.GetSamples(options.campaign));
  for (v1::Sample& sample : samples) {
    if (sample.index() == options.sample) return std::move(sample);
  }
  return absl::NotFoundError(
      absl::StrCat("campaign ", options.campaign, " has no sample ", options.sample));
}

absl::StatusOr<int> Kept(const CommonOptions& common, const KeptOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  client::Client& client = session->client();
  ASSIGN_OR_RETURN(const v1::Sample sample, SampleOf(client, options));
  ASSIGN_OR_RETURN(const auto source, client.GetSource(options.campaign));
  ASSIGN_OR_RETURN(const auto campaign, client::LoadCampaign(client, source));
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  for (const v1::KeptFile& file : sample.kept()) {
    const auto place = static_cast<std::size_t>(file.experiment());
    const std::string experiment = place < campaign.experiments.size()
                                       ? campaign.experiments[place].name
                                       : absl::StrCat(place);
    std::string path;
    if (!options.output.empty() && !file.digest().empty()) {
      ASSIGN_OR_RETURN(path, Copy(client, file, fs::path(options.output) / experiment));
    }
    files.push_back({{"experiment", experiment}, {"name", file.name()}});
    files.back()["digest"] =
        file.digest().empty() ? nlohmann::ordered_json() : nlohmann::ordered_json(file.digest());
    files.back()["reason"] = file.reason();
    files.back()["file"] = path.empty() ? nlohmann::ordered_json() : nlohmann::ordered_json(path);
    if (common.json) continue;
    std::cout << experiment << ": " << file.name()
              << (file.digest().empty() ? absl::StrCat(" did not stay: ", file.reason())
                  : path.empty()        ? ""
                                        : absl::StrCat(" -> ", path))
              << "\n";
  }
  if (common.json) {
    std::cout << nlohmann::ordered_json{{"campaign", options.campaign},
                                        {"sample", options.sample},
                                        {"kept", files}}
                     .dump(2)
              << "\n";
  } else if (files.empty()) {
    std::cout << "No file stays with sample " << options.sample
              << "; model.keep of the campaign file names those that should.\n";
  }
  return kDone;
}

}  // namespace

Verb KeptVerb() {
  return MakeVerb<KeptOptions>(
      {.name = "kept",
       .description = "Files of a user's program that stay with a sample (model.keep)",
       .example = "kept c1 17 -o files --state calib-state"},
      &Declare, &Kept);
}

}  // namespace calib::ctl
