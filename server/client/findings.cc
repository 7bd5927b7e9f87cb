#include "server/client/findings.h"

#include <iostream>

namespace calib::client {

void StoreFinding(Client& client, const std::string& campaign, const std::string& kind,
                  const std::string& document) {
  if (auto kept = client.AddFinding(campaign, kind, document); !kept.ok()) {
    std::cerr << "the " << kind << " of " << campaign
              << " is not kept, so reports will not show it: " << kept.message() << "\n";
  }
}

}  // namespace calib::client
