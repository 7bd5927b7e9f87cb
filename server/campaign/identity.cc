#include "server/campaign/identity.h"

#include "absl/strings/str_cat.h"
#include "server/campaign/sha256.h"

namespace calib::campaign {

std::string IdentityDigest(const Submission& submission) {
  // Every part is preceded by its length, so that no two submissions read the same.
  const auto part = [](const std::string& text) {
    return absl::StrCat(text.size(), ":", text, "\n");
  };
  std::string canonical = part(submission.file_name) + part(submission.campaign_file);
  for (const auto& [path, digest] : submission.files) canonical += part(path) + part(digest);
  canonical += submission.seed ? absl::StrCat("seed ", *submission.seed) : "seed of the file";
  return Sha256Hex(canonical);
}

}  // namespace calib::campaign
