#include <gmock/gmock.h>

#include <atomic>
#include <thread>
#include <vector>

#include "server/access/certificate.h"
#include "server/access/signing.h"
#include "server/access/x509.h"
#include "tests/unit/access/access_fixture.h"

namespace calib::access {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

class VerifierOfPeers : public AccessFixture {
 protected:
  /// That of a server, in the folder "head".
  std::unique_ptr<Verifier> Server() const {
    Given("head", Role::kServer);
    auto verifier = Verifier::Open(At("head"));
    EXPECT_TRUE(verifier.ok()) << verifier.status();
    return verifier.ok() ? *std::move(verifier) : nullptr;
  }
  std::string CertificateOf(const std::string& name) const {
    return ReadText(At(name + "/cert.pem"));
  }
  static std::string Refusal(Verifier& verifier, const std::string& pem, std::int64_t now) {
    const auto holder = verifier.Verify(pem, now);
    EXPECT_EQ(holder.status().code(), absl::StatusCode::kUnauthenticated) << holder.status();
    return std::string(holder.status().message());
  }
};

TEST_F(VerifierOfPeers, KnowsHoldersOfAllRolesThatAsk) {
  const auto verifier = Server();
  for (const Role role : {Role::kWorker, Role::kViewer, Role::kSubmitter, Role::kOperator}) {
    const Holder issued = Given("the-" + NameOf(role), role);
    // A chain after the leaf is passed over.
    const auto holder =
        verifier->Verify(CertificateOf(issued.name) + ReadText(At("ca/ca.pem")), Now());
    ASSERT_TRUE(holder.ok()) << holder.status();
    EXPECT_EQ(holder->name, issued.name);
    EXPECT_EQ(holder->role, role);
    EXPECT_EQ(holder->serial, issued.serial);
    EXPECT_EQ(holder->not_after_unix_s, issued.not_after_unix_s);
  }
  EXPECT_TRUE(Verifier::Open(ca()).ok()) << "the folder of the authority has both files";
  EXPECT_EQ(Verifier::Open(At("nowhere")).status().code(), absl::StatusCode::kNotFound);
}

TEST_F(VerifierOfPeers, RefusesTheCertificateOfAServer) {
  const auto verifier = Server();
  EXPECT_THAT(Refusal(*verifier, CertificateOf("head"), Now()),
              StartsWith("the certificate of head is not one to ask a server with"));
}

TEST_F(VerifierOfPeers, RefusesWhatIsNotValidNow) {
  const auto verifier = Server();
  const Holder holder = Given("node7", Role::kWorker);
  const std::string pem = CertificateOf("node7");
  EXPECT_TRUE(verifier->Verify(pem, holder.not_before_unix_s + 1).ok());
  EXPECT_TRUE(verifier->Verify(pem, holder.not_after_unix_s - 1).ok());
  EXPECT_EQ(Refusal(*verifier, pem, holder.not_after_unix_s),
            "the certificate of node7 has expired on " + DateOf(holder.not_after_unix_s) +
                " (`calibctl certs issue` renews it)");
  EXPECT_TRUE(verifier->Verify(pem, Now()).ok()) << "a clock that was put right";

  const KeyPtr ca_key = ParseKey(ReadText(At("ca/ca-key.pem")));
  const X509Ptr authority = ParseCertificate(ReadText(At("ca/ca.pem")));
  const std::int64_t begin = Now() + 3 * kOneDay;
  const auto later = SignLeaf(
      {.name = "node8", .role = Role::kWorker, .hosts = {}, .validity = {begin, begin + kOneDay}},
      ca_key.get(), authority.get(), ca_key.get());
  ASSERT_TRUE(later.ok()) << later.status();
  const std::string future = *PemOf(later->get());
  EXPECT_EQ(Refusal(*verifier, future, begin - 1), "the certificate of node8 is not valid before " +
                                                       DateOf(begin) + ": look at the clocks");
  EXPECT_TRUE(verifier->Verify(future, begin).ok());
  // Before and after the authority itself.
  EXPECT_THAT(Refusal(*verifier, pem, Now() - kOneDay),
              HasSubstr("an authority that is not valid"));
  EXPECT_THAT(Refusal(*verifier, pem, Now() + 3654 * kOneDay), HasSubstr("has expired"));
}

TEST_F(VerifierOfPeers, RefusesOtherAuthorities) {
  const auto verifier = Server();
  ASSERT_TRUE(InitAuthority(At("other")).ok());
  ASSERT_TRUE(Issue(At("other"), {.name = "eve", .role = Role::kOperator}, At("eve")).ok());
  const std::string sentence = "the certificate of eve was not issued by this server's authority";
  EXPECT_EQ(Refusal(*verifier, CertificateOf("eve"), Now()), sentence);
  EXPECT_EQ(Refusal(*verifier, CertificateOf("eve") + ReadText(At("other/ca.pem")), Now()),
            sentence);

  // An authority of the same name and key identifier: only the signature tells.
  const X509Ptr real = ParseCertificate(ReadText(At("ca/ca.pem")));
  const X509Ptr leaf = ParseCertificate(CertificateOf("eve"));
  const KeyPtr false_key = ParseKey(ReadText(At("other/ca-key.pem")));
  ASSERT_TRUE(real && leaf && false_key);
  const auto forged = SignLeaf({.name = "eve",
                                .role = Role::kOperator,
                                .hosts = {},
                                .validity = {Now() - 60, Now() + kOneDay}},
                               X509_get0_pubkey(leaf.get()), real.get(), false_key.get());
  ASSERT_TRUE(forged.ok()) << forged.status();
  EXPECT_EQ(Refusal(*verifier, *PemOf(forged->get()), Now()), sentence);

  EXPECT_THAT(Refusal(*verifier, ReadText(At("other/ca.pem")), Now()),
              HasSubstr("was not issued by"));
  EXPECT_THAT(Refusal(*verifier, "", Now()), HasSubstr("no certificate in PEM"));
  EXPECT_THAT(Refusal(*verifier, ReadText(At("eve/key.pem")), Now()), HasSubstr("no certificate"));
}

TEST_F(VerifierOfPeers, RefusesCertificatesWithoutARoleOrWithATamperedOne) {
  const auto verifier = Server();
  Given("node7", Role::kWorker);
  const KeyPtr ca_key = ParseKey(ReadText(At("ca/ca-key.pem")));
  ASSERT_TRUE(ca_key);
  const auto with_subject = [&](const char* role, const char* name) {
    const X509Ptr leaf = ParseCertificate(CertificateOf("node7"));
    X509_NAME* const subject = X509_NAME_new();
    X509_NAME_add_entry_by_txt(subject, "OU", MBSTRING_UTF8,
                               reinterpret_cast<const unsigned char*>(role), -1, -1, 0);
    X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_UTF8,
                               reinterpret_cast<const unsigned char*>(name), -1, -1, 0);
    EXPECT_EQ(X509_set_subject_name(leaf.get(), subject), 1);
    X509_NAME_free(subject);
    X509_sign(leaf.get(), ca_key.get(), EVP_sha256());
    return PemOf(leaf.get()).value_or("");
  };
  EXPECT_TRUE(verifier->Verify(with_subject("operator", "node7"), Now()).ok());
  EXPECT_THAT(Refusal(*verifier, with_subject("king", "node7"), Now()),
              HasSubstr("the certificate of node7 states no role"));
  EXPECT_THAT(Refusal(*verifier, with_subject("worker", "a b\n"), Now()),
              HasSubstr("the certificate of 'a b\\n' states no role"));
  EXPECT_THAT(Refusal(*verifier, with_subject("server", "node7"), Now()),
              HasSubstr("is not one to ask a server with"));
  // The same bytes but for the role, which the signature covers.
  const X509Ptr leaf = ParseCertificate(CertificateOf("node7"));
  unsigned char* raw = nullptr;
  const int size = i2d_X509(leaf.get(), &raw);
  ASSERT_GT(size, 0);
  std::string der(reinterpret_cast<const char*>(raw), static_cast<std::size_t>(size));
  OPENSSL_free(raw);
  const std::size_t role = der.find("worker");
  ASSERT_NE(role, std::string::npos);
  der.replace(role, 6, "viewer");
  const auto* bytes = reinterpret_cast<const unsigned char*>(der.data());
  const X509Ptr tampered(d2i_X509(nullptr, &bytes, size));
  ASSERT_TRUE(tampered);
  EXPECT_EQ(Refusal(*verifier, *PemOf(tampered.get()), Now()),
            "the certificate of node7 was not issued by this server's authority");
}

TEST_F(VerifierOfPeers, ReadsRevocationsThatReplaceItsOwn) {
  const auto verifier = Server();
  Given("node7", Role::kWorker);
  Given("node8", Role::kWorker);
  const std::int64_t now = Now();
  ASSERT_TRUE(verifier->Verify(CertificateOf("node7"), now).ok());
  ASSERT_EQ(Revoke(ca(), "node7").value_or(-1), 1);
  EXPECT_TRUE(verifier->Verify(CertificateOf("node7"), now + 1).ok()) << "not copied yet";
  Copy(At("ca/crl.pem"), At("head/crl.pem"));
  EXPECT_TRUE(verifier->Verify(CertificateOf("node7"), now + 1).ok()) << "looks once a second";
  EXPECT_EQ(Refusal(*verifier, CertificateOf("node7"), now + 2),
            "the certificate of node7 was revoked");
  EXPECT_TRUE(verifier->Verify(CertificateOf("node8"), now + 2).ok());
}

TEST_F(VerifierOfPeers, HeedsRevocationsWhateverTheClocksSay) {
  const auto verifier = Server();
  const Holder revoked = Given("node7", Role::kWorker);
  Given("node8", Role::kWorker);
  const X509Ptr authority = ParseCertificate(ReadText(At("ca/ca.pem")));
  const KeyPtr ca_key = ParseKey(ReadText(At("ca/ca-key.pem")));
  ASSERT_TRUE(authority && ca_key);
  std::int64_t now = Now();
  for (const Validity& validity :
       {Validity{now + 3600, now + kOneDay}, Validity{now - kOneDay, now - 3600}}) {
    const auto crl = SignRevocations({.revoked = {{.serial = revoked.serial,
                                                   .name = "node7",
                                                   .role = Role::kWorker,
                                                   .not_after_unix_s = revoked.not_after_unix_s,
                                                   .revoked_unix_s = now + 3600}},
                                      .number = 7,
                                      .validity = validity},
                                     authority.get(), ca_key.get());
    ASSERT_TRUE(crl.ok()) << crl.status();
    WriteText(At("head/crl.pem"), *PemOf(crl->get()));
    ++now;
    EXPECT_THAT(Refusal(*verifier, CertificateOf("node7"), now), HasSubstr("was revoked"));
    EXPECT_TRUE(verifier->Verify(CertificateOf("node8"), now).ok());
  }
}

TEST_F(VerifierOfPeers, KeepsTheLastGoodFilesWhileNewOnesAreBroken) {
  const auto verifier = Server();
  Given("node7", Role::kWorker);
  Given("node8", Role::kWorker);
  ASSERT_EQ(Revoke(ca(), "node8").value_or(-1), 1);
  Copy(At("ca/crl.pem"), At("head/crl.pem"));
  std::int64_t now = Now();
  const auto judges_as_before = [&] {
    ++now;
    EXPECT_TRUE(verifier->Verify(CertificateOf("node7"), now).ok());
    EXPECT_THAT(Refusal(*verifier, CertificateOf("node8"), now), HasSubstr("was revoked"));
  };
  judges_as_before();
  ASSERT_EQ(Revoke(ca(), "node7").value_or(-1), 1);
  const std::string next = ReadText(At("ca/crl.pem"));
  WriteText(At("head/crl.pem"), next.substr(0, next.size() / 2));
  judges_as_before();
  std::filesystem::remove(At("head/crl.pem"));
  judges_as_before();
  ASSERT_TRUE(InitAuthority(At("other")).ok());
  Copy(At("other/crl.pem"), At("head/crl.pem"));
  judges_as_before();
  WriteText(At("head/crl.pem"), next);
  EXPECT_THAT(Refusal(*verifier, CertificateOf("node7"), now + 1), HasSubstr("was revoked"));
  // Another authority takes over once both of its files are there.
  ASSERT_TRUE(Issue(At("other"), {.name = "new", .role = Role::kViewer}, At("new")).ok());
  Copy(At("other/ca.pem"), At("head/ca.pem"));
  Refusal(*verifier, CertificateOf("new"), now + 2);
  Copy(At("other/crl.pem"), At("head/crl.pem"));
  EXPECT_TRUE(verifier->Verify(CertificateOf("new"), now + 3).ok());
}

TEST_F(VerifierOfPeers, JudgesAlikeInManyThreadsWhileFilesAreReplaced) {
  const auto verifier = Server();
  Given("node7", Role::kWorker);
  Given("node8", Role::kWorker);
  ASSERT_EQ(Revoke(ca(), "node8").value_or(-1), 1);
  Copy(At("ca/crl.pem"), At("head/crl.pem"));
  const std::string good = CertificateOf("node7");
  const std::string revoked = CertificateOf("node8");
  const std::int64_t begin = Now() + 1;
  ASSERT_FALSE(verifier->Verify(revoked, begin - 1).ok());
  std::atomic<int> wrong = 0;
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 100; ++i) {
        if (!verifier->Verify(good, begin + i).ok()) ++wrong;
        if (verifier->Verify(revoked, begin + i).ok()) ++wrong;
      }
    });
  }
  for (int i = 0; i < 20; ++i) Copy(At("ca/crl.pem"), At("head/crl.pem"));  // in place, not renamed
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace calib::access
