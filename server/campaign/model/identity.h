#pragma once
// Digests by which a campaign is recognised when it is submitted again, and its data in another
// campaign.

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "server/campaign/model/campaign.h"

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

/// SHA-256 (hex) of the readings that a campaign is fitted to: names of control and observables and
/// their values, whatever the order of experiments and observables. Not of their errors, which are
/// part of a model of the data, nor of names of experiments and held-out ones.
std::string DataDigest(const Campaign& campaign);

}  // namespace calib::campaign
