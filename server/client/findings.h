#pragma once
// Conclusions about a campaign, kept at the server with it, so that its report shows them.

#include <string>
#include <vector>

#include "server/client/client.h"

namespace calib::client {

inline constexpr const char* kDiagnosis = "diagnosis";      ///< the JSON of `calibctl diagnose`
inline constexpr const char* kImprovement = "improvement";  ///< the JSON of `calibctl improve`

/// Stores a document at the server. Where that fails the answer is as good as without: a line on
/// standard error says so.
void StoreFinding(Client& client, const std::string& campaign, const std::string& kind,
                  const std::string& document);

}  // namespace calib::client
