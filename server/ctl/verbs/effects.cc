#include <iostream>
#include <string>

#include "dem/registry/declared_effects.h"
#include "server/ctl/catalog_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/source_files.h"
#include "server/ctl/verb.h"
#include "server/report/documents/json_documents.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

struct EffectsOptions {
  std::string file;  ///< campaign file; empty: the effects of this build alone
};

void Declare(OptionList& list, EffectsOptions& options) {
  list.Text("--campaign", options.file, "file of a campaign, whose user_effects are listed too");
}

absl::StatusOr<int> Effects(const CommonOptions& common, const EffectsOptions& options) {
  std::vector<dem::UserEffect> declared;
  if (!options.file.empty()) {
    const auto source = ReadSourceFiles(options.file, std::nullopt, common.json);
    if (!source) return kBadInput;
    declared = source->outcome.campaign.model.user_effects;
  }
  if (common.json) {
    std::cout << report::EffectsJson(declared);
    return kDone;
  }
  for (const dem::EffectInfo* effect : dem::AllEffects(declared)) {
    std::cout << EffectText(*effect) << "\n";
  }
  std::cout << report::Wrapped(
      "Scales: p is the pressure at which a test starts [Pa], d the mean diameter "
      "of the grains [m], E young_modulus [Pa], all as of the campaign.",
      "", "");
  return kDone;
}

}  // namespace

Verb EffectsVerb() {
  return MakeVerb<EffectsOptions>({.name = "effects",
                                   .description = "Physical effects this build offers",
                                   .example = "effects"},
                                  &Declare, &Effects);
}

}  // namespace calib::ctl
