#include <openssl/err.h>
#include <openssl/x509_vfy.h>
#include <openssl/x509v3.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <array>
#include <optional>

#include "absl/base/thread_annotations.h"
#include "absl/strings/str_cat.h"
#include "absl/synchronization/mutex.h"
#include "calib/return_if_error.h"
#include "server/access/certificate.h"
#include "server/access/x509.h"

namespace calib::access {

/// What tells one version of a file from another without reading it.
struct FileStamp {
  ino_t inode = 0;
  off_t size = -1;
  std::int64_t seconds = 0, nanoseconds = 0;  // of the last change
  bool operator==(const FileStamp&) const = default;
};
using FileStamps = std::array<FileStamp, 2>;

namespace {

struct StoreFree {
  void operator()(X509_STORE* it) const { X509_STORE_free(it); }
  void operator()(X509_STORE_CTX* it) const { X509_STORE_CTX_free(it); }
};
using StorePtr = std::unique_ptr<X509_STORE, StoreFree>;

FileStamp StampOf(const std::string& path) {
  struct stat found = {};
  if (stat(path.c_str(), &found) != 0) return {};
  return {.inode = found.st_ino,
          .size = found.st_size,
          .seconds = found.st_mtim.tv_sec,
          .nanoseconds = found.st_mtim.tv_nsec};
}

FileStamps StampsOf(const std::string& folder) {
  return {StampOf(folder + "/ca.pem"), StampOf(folder + "/crl.pem")};
}

// The newest list is the one that the folder holds: whether the clocks of authority and server
// agree does not matter.
int PassOverTimesOfRevocations(int ok, X509_STORE_CTX* context) {
  const int error = X509_STORE_CTX_get_error(context);
  if (error != X509_V_ERR_CRL_NOT_YET_VALID && error != X509_V_ERR_CRL_HAS_EXPIRED) return ok;
  X509_STORE_CTX_set_error(context, X509_V_OK);
  return 1;
}

absl::StatusOr<StorePtr> StoreOf(const Trust& trust) {
  StorePtr store(X509_STORE_new());
  if (!store || X509_STORE_add_cert(store.get(), trust.ca.get()) != 1 ||
      X509_STORE_add_crl(store.get(), trust.crl.get()) != 1 ||
      X509_STORE_set_flags(store.get(), X509_V_FLAG_CRL_CHECK | X509_V_FLAG_X509_STRICT) != 1 ||
      X509_STORE_set_purpose(store.get(), X509_PURPOSE_SSL_CLIENT) != 1) {
    return OpensslError("preparing the check of certificates");
  }
  X509_STORE_set_verify_cb(store.get(), &PassOverTimesOfRevocations);
  return store;
}

absl::StatusOr<StorePtr> ReadStore(const std::string& folder) {
  ASSIGN_OR_RETURN(const Trust trust, ReadTrust(folder));
  return StoreOf(trust);
}

absl::Status Refusal(X509* leaf, int error, int depth) {
  const std::string who = absl::StrCat("the certificate of ", NameForMessages(leaf));
  const auto refuse = [&who](const std::string& why) {
    return absl::UnauthenticatedError(absl::StrCat(who, why));
  };
  switch (error) {
    case X509_V_ERR_CERT_HAS_EXPIRED:
      if (depth > 0) return refuse(" is of an authority that has expired: make a new one");
      return refuse(absl::StrCat(" has expired on ", DateOf(UnixSeconds(X509_get0_notAfter(leaf))),
                                 " (`calibctl certs issue` renews it)"));
    case X509_V_ERR_CERT_NOT_YET_VALID:
      if (depth > 0) return refuse(" is of an authority that is not valid yet: look at the clocks");
      return refuse(absl::StrCat(" is not valid before ",
                                 DateOf(UnixSeconds(X509_get0_notBefore(leaf))),
                                 ": look at the clocks"));
    case X509_V_ERR_CERT_REVOKED:
      return refuse(" was revoked");
    case X509_V_ERR_INVALID_PURPOSE:
      return refuse(" is not one to ask a server with, as those of all roles but server are");
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT:
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT_LOCALLY:
    case X509_V_ERR_UNABLE_TO_VERIFY_LEAF_SIGNATURE:
    case X509_V_ERR_DEPTH_ZERO_SELF_SIGNED_CERT:
    case X509_V_ERR_SELF_SIGNED_CERT_IN_CHAIN:
    case X509_V_ERR_CERT_SIGNATURE_FAILURE:
    case X509_V_ERR_UNABLE_TO_GET_CRL:
      return refuse(" was not issued by this server's authority");
    default:
      return refuse(absl::StrCat(" is not accepted: ", X509_verify_cert_error_string(error)));
  }
}

}  // namespace

struct Verifier::State {
  std::string folder;
  absl::Mutex mutex{};
  std::shared_ptr<X509_STORE> store ABSL_GUARDED_BY(mutex){};
  FileStamps read ABSL_GUARDED_BY(mutex){};                   // of what is in force
  std::optional<FileStamps> broken ABSL_GUARDED_BY(mutex){};  // was logged
  std::int64_t looked_unix_s ABSL_GUARDED_BY(mutex) = 0;

  std::shared_ptr<X509_STORE> Newest(std::int64_t now_unix_s) {
    const absl::MutexLock lock(&mutex);
    if (now_unix_s == looked_unix_s) return store;
    looked_unix_s = now_unix_s;
    // Before the files are read: what changes while they are is seen the next time.
    const FileStamps found = StampsOf(folder);
    if (found == read) return store;
    auto next = ReadStore(folder);
    if (next.ok()) {
      store = *std::move(next);
      read = found;
      broken.reset();
      spdlog::info("certificates_read folder=\"{}\"", folder);
    } else if (broken != found) {
      broken = found;
      spdlog::warn("certificates_kept folder=\"{}\" reason=\"{}\"", folder,
                   std::string(next.status().message()));
    }
    return store;
  }
};

Verifier::Verifier(std::unique_ptr<State> state) : state_(std::move(state)) {}
Verifier::~Verifier() = default;

absl::StatusOr<std::unique_ptr<Verifier>> Verifier::Open(const std::string& folder) {
  auto state = std::make_unique<State>();
  state->folder = folder;
  const FileStamps found = StampsOf(folder);
  ASSIGN_OR_RETURN(StorePtr store, ReadStore(folder));
  {
    const absl::MutexLock lock(&state->mutex);
    state->store = std::move(store);
    state->read = found;
  }
  return std::unique_ptr<Verifier>(new Verifier(std::move(state)));
}

absl::StatusOr<Holder> Verifier::Verify(const std::string& cert_pem, std::int64_t now_unix_s) {
  const std::shared_ptr<X509_STORE> store = state_->Newest(now_unix_s);
  const X509Ptr leaf = ParseCertificate(cert_pem);
  if (!leaf) return absl::UnauthenticatedError("the peer shows no certificate in PEM");
  const std::unique_ptr<X509_STORE_CTX, StoreFree> context(X509_STORE_CTX_new());
  if (!context || X509_STORE_CTX_init(context.get(), store.get(), leaf.get(), nullptr) != 1) {
    return OpensslError("checking a certificate");
  }
  X509_STORE_CTX_set_time(context.get(), 0, static_cast<time_t>(now_unix_s));
  const bool is_good = X509_verify_cert(context.get()) == 1;
  ERR_clear_error();
  if (!is_good) {
    return Refusal(leaf.get(), X509_STORE_CTX_get_error(context.get()),
                   X509_STORE_CTX_get_error_depth(context.get()));
  }
  auto holder = HolderOf(leaf.get());
  if (!holder.ok()) return absl::UnauthenticatedError(std::string(holder.status().message()));
  if (holder->role == Role::kServer) return Refusal(leaf.get(), X509_V_ERR_INVALID_PURPOSE, 0);
  return holder;
}

}  // namespace calib::access
