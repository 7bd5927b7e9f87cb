#include "proto/rpc/access.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <sstream>
#include <system_error>
#include <utility>

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

/// Whether a text that was to be the name of a file may be a token: it is not repeated then.
bool MayBeSecret(const std::string& text) {
  constexpr std::size_t kManyDigits = 32;
  std::size_t digits = 0;
  for (const char c : text) {
    digits = absl::ascii_isxdigit(static_cast<unsigned char>(c)) ? digits + 1 : 0;
    if (digits >= kManyDigits) return true;
  }
  return false;
}

}  // namespace

bool IsToken(const std::string& text) {
  return text.size() == kTokenDigits &&
         text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

absl::StatusOr<std::string> ReadToken(const std::string& path) {
  const auto cannot = [&path](int error) {
    return absl::InvalidArgumentError(
        absl::StrCat(MayBeSecret(path) ? "the file of the token" : path,
                     " cannot be read: ", std::generic_category().message(error)));
  };
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) {
    return cannot(errno);
  }
  struct stat status = {};
  std::string text(kLongestTokenFile, '\0');
  const bool is_file = fstat(file, &status) == 0 && S_ISREG(status.st_mode);
  const ssize_t bytes = is_file ? read(file, text.data(), text.size()) : 0;
  const int error = errno;
  close(file);
  if (bytes < 0) {
    return cannot(error);
  }
  text.resize(static_cast<std::size_t>(bytes));
  std::string token(absl::StripAsciiWhitespace(text));
  if (!IsToken(token)) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, " holds no token, which has ", kTokenDigits,
                     " hexadecimal digits; calibd writes one to `token` of its state folder"));
  }
  return token;
}

bool AnotherAccountListens(int port) {
  for (const char* table : {"/proc/net/tcp", "/proc/net/tcp6"}) {
    std::ifstream file(table);
    std::string line;
    std::getline(file, line);  // names of columns
    while (std::getline(file, line)) {
      // sl, local address and port, remote ones, state, queues, timer, retransmits, account
      // [proc(5)]
      std::istringstream columns(line);
      std::string number, local, remote, state, queues, timer, retransmits;
      std::int64_t account = -1;
      columns >> number >> local >> remote >> state >> queues >> timer >> retransmits >> account;
      const std::size_t colon = local.rfind(':');
      constexpr const char* kListens = "0A";
      if (colon == std::string::npos || state != kListens ||
          std::strtol(local.c_str() + colon + 1, nullptr, 16) != port) {
        continue;
      }
      if (account != static_cast<std::int64_t>(geteuid())) {
        return true;
      }
    }
  }
  return false;
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
  if (!choice.token.empty()) {
    ASSIGN_OR_RETURN(access.token, ReadToken(choice.token));
    access.own_port = choice.is_own ? PortOf(address) : 0;
    return access;
  }
  if (const std::string variable(absl::StripAsciiWhitespace(Variable("CALIB_TOKEN")));
      !variable.empty()) {
    if (IsToken(variable)) {
      access.token = variable;
      return access;
    }
    auto token = ReadToken(variable);
    if (!token.ok()) {  // without the value, which may be a token that was not copied whole
      return absl::InvalidArgumentError(
          absl::StrCat("$CALIB_TOKEN is neither a token (", kTokenDigits,
                       " hexadecimal digits in lower case) nor the name of a file that holds one"));
    }
    access.token = *std::move(token);
    return access;
  }
  if (!IsLoopback(address)) {
    return access;
  }
  timespec newest{};
  for (const std::string& folder : TokenFolders()) {
    const std::string path = absl::StrCat(folder, "/", TokenName(PortOf(address)));
    auto token = ReadToken(path);
    struct stat status = {};
    if (token.ok() && stat(path.c_str(), &status) == 0 &&
        std::pair(status.st_mtim.tv_sec, status.st_mtim.tv_nsec) >=
            std::pair(newest.tv_sec, newest.tv_nsec)) {
      newest = status.st_mtim;
      access.token = *std::move(token);
      access.own_port = PortOf(address);
    }
  }
  return access;
}

}  // namespace calib::rpc
