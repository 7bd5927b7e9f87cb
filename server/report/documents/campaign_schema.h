#pragma once
// What may stand in a campaign file, from the table of keys that its reader uses
// (server/campaign/keys). Thread-safe.

#include <string>

#include "server/campaign/model/method.h"

namespace calib::report {

/// JSON Schema (draft 7) of the campaign file, by which editors complete and check. It holds names,
/// words, forms and bounds of plain numbers; what depends on other keys only `calibctl validate`
/// knows.
std::string CampaignSchema(const campaign::MethodList& methods);

/// The reference of all keys, in Markdown.
std::string KeyReference(const campaign::MethodList& methods);

}  // namespace calib::report
