#include "proto/rpc/shown_access.h"

#include <fstream>
#include <iterator>

#include "calib/return_if_error.h"

namespace calib::rpc {

absl::StatusOr<ShownAccess> FindShownAccess(const std::string& address,
                                            const AccessChoice& choice) {
  ShownAccess shown;
  ASSIGN_OR_RETURN(shown.access, FindAccess(address, choice));
  if (!shown.access.tls.empty()) {
    std::ifstream file(shown.access.tls + "/cert.pem", std::ios::binary);
    shown.certificate.assign(std::istreambuf_iterator<char>(file), {});
  }
  return shown;
}

}  // namespace calib::rpc
