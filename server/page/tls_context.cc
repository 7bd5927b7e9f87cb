#include "server/page/tls_context.h"

#include <openssl/ssl.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/access/certificate.h"
#include "server/access/x509.h"

namespace calib::page {
namespace {

constexpr std::chrono::seconds kBetweenLooks{1};

}  // namespace

absl::StatusOr<std::unique_ptr<TlsContext>> TlsContext::Open(const std::string& folder) {
  std::unique_ptr<TlsContext> context(new TlsContext(folder));
  if (const absl::Status read = context->Read(); !read.ok()) {
    return absl::InvalidArgumentError(read.message());
  }
  return context;
}

std::filesystem::file_time_type TlsContext::Changed() const {
  std::filesystem::file_time_type last{};
  for (const char* name : {"/cert.pem", "/key.pem", "/ca.pem"}) {
    std::error_code gone;
    const auto written = std::filesystem::last_write_time(folder_ + name, gone);
    if (!gone) last = std::max(last, written);
  }
  return last;
}

absl::Status TlsContext::Read() {
  const auto changed = Changed();
  ASSIGN_OR_RETURN(const auto credentials, access::ReadCredentials(folder_));
  auto context = std::make_shared<boost::asio::ssl::context>(boost::asio::ssl::context::tls_server);
  SSL_CTX* raw = context->native_handle();
  const auto certificate = access::ParseCertificate(credentials.cert_pem);
  const auto key = access::ParseKey(credentials.key_pem);
  const auto authority = access::ParseCertificate(credentials.ca_pem);
  if (SSL_CTX_set_min_proto_version(raw, TLS1_2_VERSION) != 1 ||
      SSL_CTX_use_certificate(raw, certificate.get()) != 1 ||
      SSL_CTX_use_PrivateKey(raw, key.get()) != 1 ||
      SSL_CTX_add_client_CA(raw, authority.get()) != 1) {
    return access::OpensslError(absl::StrCat(folder_, ": TLS"));
  }
  // A session that is taken up again has shown no certificate anew.
  SSL_CTX_set_session_cache_mode(raw, SSL_SESS_CACHE_OFF);
  SSL_CTX_set_options(raw, SSL_OP_NO_TICKET | SSL_OP_NO_RENEGOTIATION);
  SSL_CTX_set_verify(raw, SSL_VERIFY_PEER, [](int, X509_STORE_CTX*) { return 1; });
  context_ = std::move(context);
  read_ = changed;
  return absl::OkStatus();
}

std::shared_ptr<boost::asio::ssl::context> TlsContext::Current() {
  const auto now = std::chrono::steady_clock::now();
  if (now - looked_ > kBetweenLooks) {
    looked_ = now;
    if (Changed() != read_) (void)Read();
  }
  return context_;
}

}  // namespace calib::page
