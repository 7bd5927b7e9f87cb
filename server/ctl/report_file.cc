#include "server/ctl/report_file.h"

#include <nlohmann/json.hpp>
#include <string_view>

#include "absl/strings/escaping.h"
#include "calib/return_if_error.h"
#include "proto/rpc/digest.h"
#include "server/client/report_documents.h"
#include "server/page/bundle.h"
#include "server/report/documents/report_page.h"

namespace calib::ctl {
namespace {

std::string_view BundledContent(std::string_view name) {
  for (const page::BundledFile& file : page::Bundle()) {
    if (file.name == name) return file.content;
  }
  return {};
}

}  // namespace

bool CanReport() { return !page::Bundle().empty(); }

absl::StatusOr<std::string> ReportFile(client::Client& client, const std::string& campaign) {
  if (!CanReport()) {
    return absl::FailedPreconditionError(
        "a report shows the figures of the live page, and this build has none "
        "(-DCALIB_PAGE=OFF); `calibctl export` writes the numbers");
  }
  ASSIGN_OR_RETURN(const auto documents, client::ReportDocuments(client, campaign));
  const auto shown = nlohmann::json::parse(documents.at("campaigns/" + campaign), nullptr, false);
  const std::string name = shown.value("name", campaign);
  const std::string_view script = BundledContent("page.js");
  const std::string hash = absl::HexStringToBytes(rpc::Sha256Hex(script));
  return report::ReportPage(campaign, name + " – calibration report", documents,
                            {.style = BundledContent("page.css"),
                             .script = script,
                             .script_hash = absl::Base64Escape(hash)});
}

}  // namespace calib::ctl
