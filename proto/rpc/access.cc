#include "proto/rpc/access.h"

#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "proto/rpc/address.h"

namespace calib::rpc {
namespace {

constexpr std::size_t kTokenDigits = 64;
constexpr std::size_t kLongestTokenFile = 4096;

std::string Variable(const char* name) {
  const char* const value = std::getenv(name);
  return value != nullptr ? value : "";
}

}  // namespace

bool IsToken(const std::string& text) {
  return text.size() == kTokenDigits &&
         text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

absl::StatusOr<std::string> ReadToken(const std::string& path) {
  errno = 0;
  std::ifstream file(path);
  std::string text(kLongestTokenFile, '\0');
  if (file) {
    file.read(text.data(), static_cast<std::streamsize>(text.size()));
    text.resize(static_cast<std::size_t>(file.gcount()));
  }
  if (!file.is_open() || file.bad()) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, " cannot be read: ", std::generic_category().message(errno)));
  }
  std::string token(absl::StripAsciiWhitespace(text));
  if (!IsToken(token)) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, " holds no token, which has ", kTokenDigits,
                     " hexadecimal digits; calibd writes one to `token` of its state folder"));
  }
  return token;
}

std::vector<std::string> TokenFolders() {
  std::vector<std::string> folders;
  if (const std::string runtime = Variable("XDG_RUNTIME_DIR"); !runtime.empty()) {
    folders.push_back(runtime + "/calib");
  }
  if (const std::string home = Variable("HOME"); !home.empty()) {
    folders.push_back(home + "/.cache/calib");
  }
  return folders;
}

std::string TokenName(int port) { return absl::StrCat(port, ".token"); }

absl::StatusOr<Access> FindAccess(const std::string& address, const AccessChoice& choice) {
  if (!SocketPathOf(address).empty()) {
    return Access();
  }
  Access access{.tls = choice.tls.empty() ? Variable("CALIB_TLS") : choice.tls};
  if (!access.tls.empty()) {
    for (const char* name : {"ca.pem", "cert.pem", "key.pem"}) {
      const std::string path = absl::StrCat(access.tls, "/", name);
      if (::access(path.c_str(), R_OK) != 0) {
        return absl::InvalidArgumentError(
            absl::StrCat(path, " cannot be read: ", std::generic_category().message(errno),
                         "; --tls names a folder that `calibctl certs issue` has written"));
      }
    }
    if (choice.token.empty()) {
      return access;
    }
  }
  const std::string variable = Variable("CALIB_TOKEN");
  if (choice.token.empty() && IsToken(variable)) {
    access.token = variable;
    return access;
  }
  if (const std::string& file = choice.token.empty() ? variable : choice.token; !file.empty()) {
    ASSIGN_OR_RETURN(access.token, ReadToken(file));
    return access;
  }
  if (!IsLoopback(address)) {
    return access;
  }
  for (const std::string& folder : TokenFolders()) {
    if (auto token = ReadToken(absl::StrCat(folder, "/", TokenName(PortOf(address)))); token.ok()) {
      access.token = *std::move(token);
      return access;
    }
  }
  return access;
}

}  // namespace calib::rpc
