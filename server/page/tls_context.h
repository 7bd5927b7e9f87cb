#pragma once
// What the HTTP server shows over TLS, and what it asks for.

#include <boost/asio/ssl/context.hpp>
#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace calib::page {

/// TLS 1.2 or later, with the certificate of a folder of `calibctl certs issue`, read again when
/// its files change. A peer may show a certificate, which is not judged here (access::Verifier).
/// Not thread-safe.
class TlsContext {
 public:
  /// Errors: those of access::ReadCredentials, as INVALID_ARGUMENT.
  static absl::StatusOr<std::unique_ptr<TlsContext>> Open(const std::string& folder);
  /// For the next connection. Files that are broken leave the last good ones.
  std::shared_ptr<boost::asio::ssl::context> Current();

 private:
  explicit TlsContext(std::string folder) : folder_(std::move(folder)) {}
  absl::Status Read();
  std::filesystem::file_time_type Changed() const;

  const std::string folder_;
  std::shared_ptr<boost::asio::ssl::context> context_;
  std::filesystem::file_time_type read_{};
  std::chrono::steady_clock::time_point looked_{};
};

}  // namespace calib::page
