#include "server/access/signing.h"

#include <arpa/inet.h>
#include <openssl/bn.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>
#include <unistd.h>

#include <array>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"

namespace calib::access {
namespace {

constexpr int kVersion3 = 2;  // of certificates, as the field counts
constexpr int kCrlVersion2 = 1;
constexpr int kSerialBits = 128;
constexpr std::size_t kHostnameInAuthority = 32;  // [bytes], so that the name stays below 64

absl::StatusOr<std::string> RandomHex(int bytes) {
  std::string raw(static_cast<std::size_t>(bytes), '\0');
  if (RAND_bytes(reinterpret_cast<unsigned char*>(raw.data()), bytes) != 1) {
    return OpensslError("drawing random bytes");
  }
  return absl::BytesToHexString(raw);
}

std::string OwnHostname() {
  std::array<char, 256> text{};
  gethostname(text.data(), text.size() - 1);
  std::string name = text.data();
  for (char& c : name) {
    if (!absl::ascii_isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '-') c = '-';
  }
  return name.substr(0, kHostnameInAuthority);
}

bool AddEntry(X509_NAME* name, const char* kind, const std::string& text) {
  return X509_NAME_add_entry_by_txt(name, kind, MBSTRING_UTF8,
                                    reinterpret_cast<const unsigned char*>(text.data()),
                                    static_cast<int>(text.size()), -1, 0) == 1;
}

bool SetRandomSerial(X509* certificate) {
  BIGNUM* const number = BN_new();
  const bool done = number != nullptr &&
                    BN_rand(number, kSerialBits, BN_RAND_TOP_ANY, BN_RAND_BOTTOM_ANY) == 1 &&
                    BN_to_ASN1_INTEGER(number, X509_get_serialNumber(certificate)) != nullptr;
  BN_free(number);
  return done;
}

bool SetValidity(X509* certificate, const Validity& validity) {
  return ASN1_TIME_set(X509_getm_notBefore(certificate), validity.not_before_unix_s) != nullptr &&
         ASN1_TIME_set(X509_getm_notAfter(certificate), validity.not_after_unix_s) != nullptr;
}

struct Extension {
  int kind;  // NID_...
  std::string value;
};

/// For a certificate or, where `crl` is not null, a list. Values are ours or have been checked:
/// OpenSSL gives commas and colons in them a meaning.
bool AddExtension(X509V3_CTX* context, X509* certificate, X509_CRL* crl, const Extension& it) {
  X509_EXTENSION* const made = X509V3_EXT_nconf_nid(nullptr, context, it.kind, it.value.c_str());
  const bool done = made != nullptr && (crl != nullptr ? X509_CRL_add_ext(crl, made, -1) == 1
                                                       : X509_add_ext(certificate, made, -1) == 1);
  X509_EXTENSION_free(made);
  return done;
}

bool AddExtensions(X509* certificate, X509* ca, const std::vector<Extension>& extensions) {
  X509V3_CTX context;
  X509V3_set_ctx(&context, ca, certificate, nullptr, nullptr, 0);
  for (const Extension& extension : extensions) {
    if (!AddExtension(&context, certificate, nullptr, extension)) return false;
  }
  return true;
}

std::string AlternativeNames(const std::vector<std::string>& hosts) {
  std::string value;
  for (const std::string& host : hosts) {
    absl::StrAppend(&value, value.empty() ? "" : ",", IsAddress(host) ? "IP:" : "DNS:", host);
  }
  return value;
}

bool AddRevoked(X509_CRL* crl, const IssuedCertificate& row) {
  BIGNUM* number = nullptr;
  X509_REVOKED* const entry = X509_REVOKED_new();
  ASN1_TIME* const when = ASN1_TIME_set(nullptr, *row.revoked_unix_s);
  bool done = entry != nullptr && when != nullptr && BN_hex2bn(&number, row.serial.c_str()) > 0;
  ASN1_INTEGER* const serial = done ? BN_to_ASN1_INTEGER(number, nullptr) : nullptr;
  done = serial != nullptr && X509_REVOKED_set_serialNumber(entry, serial) == 1 &&
         X509_REVOKED_set_revocationDate(entry, when) == 1 &&
         X509_CRL_add0_revoked(crl, entry) == 1;
  ASN1_INTEGER_free(serial);
  ASN1_TIME_free(when);
  BN_free(number);
  if (!done) X509_REVOKED_free(entry);
  return done;
}

}  // namespace

bool IsAddress(const std::string& host) {
  std::array<unsigned char, 16> bytes{};
  return inet_pton(AF_INET, host.c_str(), bytes.data()) == 1 ||
         inet_pton(AF_INET6, host.c_str(), bytes.data()) == 1;
}

absl::StatusOr<KeyPtr> MakeKey() {
  KeyPtr key(EVP_EC_gen("P-256"));
  if (!key) return OpensslError("making a key");
  return key;
}

absl::StatusOr<X509Ptr> SignAuthority(EVP_PKEY* key, const Validity& validity) {
  ASSIGN_OR_RETURN(const std::string random, RandomHex(8));
  const X509Ptr made(X509_new());
  X509* const ca = made.get();
  if (ca == nullptr || X509_set_version(ca, kVersion3) != 1 || !SetRandomSerial(ca) ||
      !SetValidity(ca, validity) || X509_set_pubkey(ca, key) != 1 ||
      !AddEntry(X509_get_subject_name(ca), "CN",
                absl::StrCat("calib authority ", OwnHostname(), " ", random)) ||
      X509_set_issuer_name(ca, X509_get_subject_name(ca)) != 1 ||
      !AddExtensions(ca, ca,
                     {{NID_basic_constraints, "critical,CA:TRUE,pathlen:0"},
                      {NID_key_usage, "critical,keyCertSign,cRLSign"},
                      {NID_subject_key_identifier, "hash"}}) ||
      X509_sign(ca, key, EVP_sha256()) <= 0) {
    return OpensslError("making the certificate of an authority");
  }
  // As it is written and read, with what OpenSSL derives when it parses.
  ASSIGN_OR_RETURN(const std::string pem, PemOf(ca));
  return ParseCertificate(pem);
}

absl::StatusOr<X509Ptr> SignLeaf(const Leaf& leaf, EVP_PKEY* key, X509* ca, EVP_PKEY* ca_key) {
  std::vector<Extension> extensions = {
      {NID_basic_constraints, "critical,CA:FALSE"},
      {NID_key_usage, "critical,digitalSignature"},
      {NID_ext_key_usage, leaf.role == Role::kServer ? "serverAuth" : "clientAuth"},
      {NID_subject_key_identifier, "hash"},
      {NID_authority_key_identifier, "keyid:always"}};
  if (!leaf.hosts.empty()) {
    extensions.push_back({NID_subject_alt_name, AlternativeNames(leaf.hosts)});
  }
  const X509Ptr made(X509_new());
  X509* const it = made.get();
  if (it == nullptr || X509_set_version(it, kVersion3) != 1 || !SetRandomSerial(it) ||
      !SetValidity(it, leaf.validity) || X509_set_pubkey(it, key) != 1 ||
      !AddEntry(X509_get_subject_name(it), "OU", NameOf(leaf.role)) ||
      !AddEntry(X509_get_subject_name(it), "CN", leaf.name) ||
      X509_set_issuer_name(it, X509_get_subject_name(ca)) != 1 ||
      !AddExtensions(it, ca, extensions) || X509_sign(it, ca_key, EVP_sha256()) <= 0) {
    return OpensslError("making a certificate");
  }
  ASSIGN_OR_RETURN(const std::string pem, PemOf(it));
  return ParseCertificate(pem);
}

absl::StatusOr<CrlPtr> SignRevocations(const RevocationList& list, X509* ca, EVP_PKEY* ca_key) {
  const CrlPtr made(X509_CRL_new());
  X509_CRL* const crl = made.get();
  if (crl == nullptr || X509_CRL_set_version(crl, kCrlVersion2) != 1 ||
      X509_CRL_set_issuer_name(crl, X509_get_subject_name(ca)) != 1) {
    return OpensslError("making a list of revocations");
  }
  ASN1_TIME* const from = ASN1_TIME_set(nullptr, list.validity.not_before_unix_s);
  ASN1_TIME* const to = ASN1_TIME_set(nullptr, list.validity.not_after_unix_s);
  bool done = from != nullptr && to != nullptr && X509_CRL_set1_lastUpdate(crl, from) == 1 &&
              X509_CRL_set1_nextUpdate(crl, to) == 1;
  ASN1_TIME_free(from);
  ASN1_TIME_free(to);
  for (const IssuedCertificate& row : list.revoked) done = done && AddRevoked(crl, row);
  X509V3_CTX context;
  X509V3_set_ctx(&context, ca, nullptr, nullptr, crl, 0);
  ASN1_INTEGER* const number = ASN1_INTEGER_new();
  done = done && number != nullptr && ASN1_INTEGER_set_int64(number, list.number) == 1 &&
         X509_CRL_add1_ext_i2d(crl, NID_crl_number, number, 0, 0) == 1 &&
         AddExtension(&context, nullptr, crl, {NID_authority_key_identifier, "keyid:always"}) &&
         X509_CRL_sort(crl) == 1 && X509_CRL_sign(crl, ca_key, EVP_sha256()) > 0;
  ASN1_INTEGER_free(number);
  if (!done) return OpensslError("making a list of revocations");
  ASSIGN_OR_RETURN(const std::string pem, PemOf(crl));
  return ParseRevocations(pem);
}

std::int64_t NumberOf(X509_CRL* revocations) {
  auto* const number = static_cast<ASN1_INTEGER*>(
      X509_CRL_get_ext_d2i(revocations, NID_crl_number, nullptr, nullptr));
  std::int64_t result = 0;
  if (number == nullptr || ASN1_INTEGER_get_int64(&result, number) != 1) result = 0;
  ASN1_INTEGER_free(number);
  return result;
}

}  // namespace calib::access
