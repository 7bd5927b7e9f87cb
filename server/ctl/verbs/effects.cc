#include <iostream>

#include "server/ctl/catalog_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/source_files.h"
#include "server/ctl/verbs.h"
#include "server/report/documents/json_documents.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {

int Effects(const Arguments& arguments) {
  std::vector<dem::UserEffect> declared;
  if (!arguments.file.empty()) {
    const auto source = ReadSourceFiles(arguments);
    if (!source) return kBadInput;
    declared = source->outcome.campaign.model.user_effects;
  }
  if (arguments.json) {
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

}  // namespace calib::ctl
