#pragma once
// The digest by which a campaign is recognised when it is submitted again.

#include <cstdint>
#include <map>
#include <optional>
#include <string>

namespace calib::campaign {

/// What a submission consists of.
struct Submission {
  std::string campaign_file;                 ///< the YAML text
  std::string file_name;                     ///< its name, without folders
  std::map<std::string, std::string> files;  ///< path as written -> SHA-256 of the content
  std::optional<std::uint64_t> seed;         ///< overrides the file's
};

/// SHA-256 (hex) over all of it; equal exactly when two submissions are equal.
std::string IdentityDigest(const Submission& submission);

}  // namespace calib::campaign
