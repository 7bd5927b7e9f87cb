#include "proto/rpc/server_certificate.h"

#include <grpcpp/security/tls_certificate_verifier.h>
#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <functional>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"

namespace calib::rpc {
namespace {

using grpc::experimental::TlsCustomVerificationCheckRequest;

struct Free {
  void operator()(BIO* it) const { BIO_free(it); }
  void operator()(X509* it) const { X509_free(it); }
  void operator()(X509_CRL* it) const { X509_CRL_free(it); }
};
using BioPtr = std::unique_ptr<BIO, Free>;

grpc::Status NotTaken(const std::string& why) {
  ERR_clear_error();
  return {grpc::StatusCode::UNAUTHENTICATED, why};
}

grpc::Status CheckRevocations(std::string_view certificate_pem, const std::string& path) {
  const BioPtr shown(
      BIO_new_mem_buf(certificate_pem.data(), static_cast<int>(certificate_pem.size())));
  const std::unique_ptr<X509, Free> certificate(
      PEM_read_bio_X509(shown.get(), nullptr, nullptr, nullptr));
  if (!certificate) return NotTaken("the server shows no certificate in PEM");
  const BioPtr file(BIO_new_file(path.c_str(), "r"));
  const std::unique_ptr<X509_CRL, Free> list(
      file ? PEM_read_bio_X509_CRL(file.get(), nullptr, nullptr, nullptr) : nullptr);
  if (!list) return NotTaken(absl::StrCat(path, " holds no list of revocations in PEM"));
  X509_REVOKED* found = nullptr;
  if (X509_CRL_get0_by_cert(list.get(), &found, certificate.get()) != 0) {
    return NotTaken(absl::StrCat("the server's ", kRevoked));
  }
  return grpc::Status::OK;
}

class ServerVerifier final : public grpc::experimental::ExternalCertificateVerifier {
 public:
  explicit ServerVerifier(std::string folder) : revocations_(std::move(folder) + "/crl.pem") {}

  bool Verify(TlsCustomVerificationCheckRequest* request,
              std::function<void(grpc::Status)> callback, grpc::Status* status) override {
    if (!host_.Verify(request, std::move(callback), status)) return false;
    if (status->ok()) {
      const grpc::string_ref shown = request->peer_cert();
      *status = CheckRevocations({shown.data(), shown.size()}, revocations_);
    }
    return true;
  }
  void Cancel(TlsCustomVerificationCheckRequest* request) override { host_.Cancel(request); }

 private:
  const std::string revocations_;
  grpc::experimental::HostNameCertificateVerifier host_;  // answers at once
};

}  // namespace

std::shared_ptr<grpc::experimental::CertificateVerifier> MakeServerVerifier(std::string folder) {
  return grpc::experimental::ExternalCertificateVerifier::Create<ServerVerifier>(std::move(folder));
}

}  // namespace calib::rpc
