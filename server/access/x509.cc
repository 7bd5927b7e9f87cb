#include "server/access/x509.h"

#include <arpa/inet.h>
#include <openssl/bio.h>
#include <openssl/bn.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <array>
#include <ctime>
#include <optional>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "server/access/files.h"

namespace calib::access {
namespace {

constexpr std::size_t kLongestName = 64;  // of a commonName: RFC 5280, ub-common-name

struct BioFree {
  void operator()(BIO* it) const { BIO_free(it); }
};
using BioPtr = std::unique_ptr<BIO, BioFree>;

BioPtr BioOver(const std::string& text) {
  return BioPtr(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

std::string TextIn(const BioPtr& bio) {
  char* text = nullptr;
  const long size = BIO_get_mem_data(bio.get(), &text);  // NOLINT(google-runtime-int)
  return {text, static_cast<std::size_t>(size)};
}

// Without it OpenSSL asks at the terminal.
int NoPassword(char*, int, int, void*) { return -1; }

/// The one entry of that kind in the subject; none where there are several.
std::optional<std::string> SubjectEntry(X509* certificate, int kind) {
  const X509_NAME* const subject = X509_get_subject_name(certificate);
  const int at = X509_NAME_get_index_by_NID(subject, kind, -1);
  if (at < 0 || X509_NAME_get_index_by_NID(subject, kind, at) >= 0) return std::nullopt;
  unsigned char* text = nullptr;
  const ASN1_STRING* const entry = X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, at));
  const int size = ASN1_STRING_to_UTF8(&text, entry);
  if (size < 0) return std::nullopt;
  std::string result(reinterpret_cast<const char*>(text), static_cast<std::size_t>(size));
  OPENSSL_free(text);
  return result;
}

std::string AddressIn(const ASN1_OCTET_STRING* bytes) {
  const int family = ASN1_STRING_length(bytes) == 4 ? AF_INET : AF_INET6;
  if (family == AF_INET6 && ASN1_STRING_length(bytes) != 16) return "";
  std::array<char, INET6_ADDRSTRLEN> text{};
  inet_ntop(family, ASN1_STRING_get0_data(bytes), text.data(), text.size());
  return text.data();
}

std::vector<std::string> HostsIn(X509* certificate) {
  std::vector<std::string> hosts;
  auto* const names = static_cast<GENERAL_NAMES*>(
      X509_get_ext_d2i(certificate, NID_subject_alt_name, nullptr, nullptr));
  for (int i = 0; i < sk_GENERAL_NAME_num(names); ++i) {
    const GENERAL_NAME* const name = sk_GENERAL_NAME_value(names, i);
    if (name->type == GEN_DNS) {
      hosts.emplace_back(reinterpret_cast<const char*>(ASN1_STRING_get0_data(name->d.dNSName)),
                         static_cast<std::size_t>(ASN1_STRING_length(name->d.dNSName)));
    } else if (name->type == GEN_IPADD) {
      hosts.push_back(AddressIn(name->d.iPAddress));
    }
  }
  GENERAL_NAMES_free(names);
  return hosts;
}

}  // namespace

absl::Status OpensslError(const std::string& what) {
  std::vector<std::string> reasons;
  while (const unsigned long code = ERR_get_error()) {  // NOLINT(google-runtime-int)
    const char* const reason = ERR_reason_error_string(code);
    reasons.emplace_back(reason != nullptr ? reason : "OpenSSL gives no reason");
  }
  return absl::InternalError(absl::StrCat(
      what,
      " failed: ", reasons.empty() ? "OpenSSL gives no reason" : absl::StrJoin(reasons, ", ")));
}

X509Ptr ParseCertificate(const std::string& pem) {
  X509Ptr result(PEM_read_bio_X509(BioOver(pem).get(), nullptr, &NoPassword, nullptr));
  ERR_clear_error();
  return result;
}

CrlPtr ParseRevocations(const std::string& pem) {
  CrlPtr result(PEM_read_bio_X509_CRL(BioOver(pem).get(), nullptr, &NoPassword, nullptr));
  ERR_clear_error();
  return result;
}

KeyPtr ParseKey(const std::string& pem) {
  KeyPtr result(PEM_read_bio_PrivateKey(BioOver(pem).get(), nullptr, &NoPassword, nullptr));
  ERR_clear_error();
  return result;
}

absl::StatusOr<std::string> PemOf(X509* certificate) {
  const BioPtr bio(BIO_new(BIO_s_mem()));
  if (!bio || PEM_write_bio_X509(bio.get(), certificate) != 1) {
    return OpensslError("writing a certificate");
  }
  return TextIn(bio);
}

absl::StatusOr<std::string> PemOf(X509_CRL* revocations) {
  const BioPtr bio(BIO_new(BIO_s_mem()));
  if (!bio || PEM_write_bio_X509_CRL(bio.get(), revocations) != 1) {
    return OpensslError("writing a list of revocations");
  }
  return TextIn(bio);
}

absl::StatusOr<std::string> PemOf(EVP_PKEY* key) {
  const BioPtr bio(BIO_new(BIO_s_secmem()));
  if (!bio ||
      PEM_write_bio_PKCS8PrivateKey(bio.get(), key, nullptr, nullptr, 0, nullptr, nullptr) != 1) {
    return OpensslError("writing a key");
  }
  return TextIn(bio);
}

bool IsKeyOf(EVP_PKEY* key, X509* certificate) {
  const bool is = X509_check_private_key(certificate, key) == 1;
  ERR_clear_error();
  return is;
}

bool IsIssuedBy(X509* certificate, X509* authority) {
  const bool is = X509_check_issued(authority, certificate) == X509_V_OK &&
                  X509_verify(certificate, X509_get0_pubkey(authority)) == 1;
  ERR_clear_error();
  return is;
}

bool IsIssuedBy(X509_CRL* revocations, X509* authority) {
  const bool is =
      X509_NAME_cmp(X509_CRL_get_issuer(revocations), X509_get_subject_name(authority)) == 0 &&
      X509_CRL_verify(revocations, X509_get0_pubkey(authority)) == 1;
  ERR_clear_error();
  return is;
}

std::string HexOf(const ASN1_INTEGER* serial) {
  BIGNUM* const number = ASN1_INTEGER_to_BN(serial, nullptr);
  char* const digits = BN_bn2hex(number);
  std::string result = digits != nullptr ? digits : "";
  OPENSSL_free(digits);
  BN_free(number);
  absl::AsciiStrToLower(&result);
  return result;
}

std::int64_t UnixSeconds(const ASN1_TIME* time) {
  std::tm parts = {};
  return ASN1_TIME_to_tm(time, &parts) == 1 ? timegm(&parts) : 0;
}

std::vector<std::string> RevokedSerials(X509_CRL* revocations) {
  std::vector<std::string> serials;
  STACK_OF(X509_REVOKED)* const all = X509_CRL_get_REVOKED(revocations);
  serials.reserve(static_cast<std::size_t>(std::max(0, sk_X509_REVOKED_num(all))));
  for (int i = 0; i < sk_X509_REVOKED_num(all); ++i) {
    serials.push_back(HexOf(X509_REVOKED_get0_serialNumber(sk_X509_REVOKED_value(all, i))));
  }
  std::sort(serials.begin(), serials.end());
  return serials;
}

bool IsName(const std::string& name) {
  return !name.empty() && name.size() <= kLongestName &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) {
           return absl::ascii_isalnum(c) || c == '.' || c == '_' || c == '@' || c == '-';
         });
}

std::string NameForMessages(X509* certificate) {
  std::string name = SubjectEntry(certificate, NID_commonName).value_or("");
  if (IsName(name)) return name;
  return name.empty() ? "nobody"
                      : absl::StrCat("'", absl::CHexEscape(name).substr(0, kLongestName), "'");
}

absl::StatusOr<Holder> HolderOf(X509* certificate) {
  const auto name = SubjectEntry(certificate, NID_commonName);
  const auto word = SubjectEntry(certificate, NID_organizationalUnitName);
  const std::optional<Role> role = word ? RoleOf(*word) : std::nullopt;
  if (!name || !IsName(*name) || !role) {
    return absl::InvalidArgumentError(
        absl::StrCat("the certificate of ", NameForMessages(certificate),
                     " states no role: it is not one of `calibctl certs issue`"));
  }
  return Holder{.name = *name,
                .role = *role,
                .serial = HexOf(X509_get0_serialNumber(certificate)),
                .not_before_unix_s = UnixSeconds(X509_get0_notBefore(certificate)),
                .not_after_unix_s = UnixSeconds(X509_get0_notAfter(certificate)),
                .hosts = HostsIn(certificate)};
}

absl::StatusOr<Trust> ReadTrust(const std::string& folder) {
  const std::string ca_path = folder + "/ca.pem";
  const std::string crl_path = folder + "/crl.pem";
  Trust trust;
  ASSIGN_OR_RETURN(trust.ca_pem, ReadFile(ca_path));
  ASSIGN_OR_RETURN(trust.crl_pem, ReadFile(crl_path));
  trust.ca = ParseCertificate(trust.ca_pem);
  trust.crl = ParseRevocations(trust.crl_pem);
  if (!trust.ca || X509_check_ca(trust.ca.get()) < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(ca_path, " holds no certificate of an authority in PEM, as `calibctl certs ",
                     "init` writes it"));
  }
  if (!trust.crl) {
    return absl::InvalidArgumentError(absl::StrCat(
        crl_path, " holds no list of revocations in PEM: copy crl.pem of the authority there"));
  }
  if (!IsIssuedBy(trust.crl.get(), trust.ca.get())) {
    return absl::InvalidArgumentError(absl::StrCat(crl_path, " is of another authority than ",
                                                   ca_path,
                                                   ": copy crl.pem of the same authority there"));
  }
  return trust;
}

}  // namespace calib::access
