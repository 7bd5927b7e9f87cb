#include <iostream>

#include "server/ctl/catalog_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verbs.h"
#include "server/report/json_documents.h"

namespace calib::ctl {

int Effects(const Arguments& arguments) {
  if (arguments.json) {
    std::cout << report::EffectsJson();
    return kDone;
  }
  for (const dem::EffectInfo& effect : dem::Effects()) {
    std::cout << effect.name << " (" << effect.kind << ")\n  " << effect.description << "\n  "
              << effect.reference << "\n"
              << ParameterTable(effect.parameters) << "\n";
  }
  return kDone;
}

}  // namespace calib::ctl
