#include "server/access/certificate.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <atomic>
#include <thread>

#include "server/access/x509.h"
#include "tests/unit/access/access_fixture.h"

namespace calib::access {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class CredentialsFolder : public AccessFixture {
 protected:
  std::string MessageAt(const std::string& folder, absl::StatusCode code) const {
    const auto read = ReadCredentials(At(folder));
    EXPECT_EQ(read.status().code(), code) << read.status();
    return std::string(read.status().message());
  }
  static bool BelongTogether(const Credentials& pair) {
    const X509Ptr certificate = ParseCertificate(pair.cert_pem);
    const KeyPtr key = ParseKey(pair.key_pem);
    return certificate && key && IsKeyOf(key.get(), certificate.get());
  }
};

TEST_F(CredentialsFolder, IsReadAsItWasIssued) {
  const Holder holder = Given("node7", Role::kWorker);
  const auto read = ReadCredentials(At("node7"));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->holder.name, "node7");
  EXPECT_EQ(read->holder.role, Role::kWorker);
  EXPECT_EQ(read->holder.serial, holder.serial);
  EXPECT_EQ(read->ca_pem, ReadText(At("ca/ca.pem")));
  EXPECT_EQ(read->cert_pem, ReadText(At("node7/cert.pem")));
  EXPECT_EQ(read->key_pem, ReadText(At("node7/key.pem")));
  EXPECT_EQ(read->crl_pem, ReadText(At("ca/crl.pem")));
  EXPECT_TRUE(BelongTogether(*read));
}

TEST_F(CredentialsFolder, ThatLacksAFileSaysWhichAndWhatWritesIt) {
  EXPECT_THAT(MessageAt("nowhere", absl::StatusCode::kNotFound),
              AllOf(HasSubstr("nowhere/ca.pem is not there"), HasSubstr("calibctl certs issue")));
  for (const char* const name : {"ca.pem", "cert.pem", "key.pem", "crl.pem"}) {
    const std::string folder = std::string("without-") + name;
    std::filesystem::create_directory(At(folder));
    ASSERT_TRUE(Issue(ca(), {.name = "n", .role = Role::kWorker}, At(folder)).ok());
    std::filesystem::remove(At(folder) + "/" + name);
    EXPECT_THAT(MessageAt(folder, absl::StatusCode::kNotFound),
                HasSubstr(folder + "/" + name + " is not there"));
  }
}

TEST_F(CredentialsFolder, ThatHoldsSomethingElseSaysWhichFile) {
  Given("node7", Role::kWorker);
  for (const char* const name : {"ca.pem", "cert.pem", "key.pem", "crl.pem"}) {
    const std::string path = At("node7") + "/" + name;
    const std::string good = ReadText(path);
    for (const std::string& bad :
         {std::string(), std::string("no PEM"), good.substr(0, good.size() / 2)}) {
      WriteText(path, bad);
      EXPECT_THAT(MessageAt("node7", absl::StatusCode::kInvalidArgument), HasSubstr(path));
    }
    WriteText(path, good);
    EXPECT_TRUE(ReadCredentials(At("node7")).ok());
  }
}

TEST_F(CredentialsFolder, KeyMayBeReadByItsOwnerOnly) {
  Given("node7", Role::kWorker);
  for (const mode_t mode : {0640U, 0604U, 0620U, 0601U}) {
    ASSERT_EQ(chmod(At("node7/key.pem").c_str(), mode), 0);
    EXPECT_THAT(MessageAt("node7", absl::StatusCode::kPermissionDenied), HasSubstr("chmod 600"));
  }
  ASSERT_EQ(chmod(At("node7/key.pem").c_str(), 0400), 0);
  EXPECT_TRUE(ReadCredentials(At("node7")).ok());
}

TEST_F(CredentialsFolder, FilesOfTwoFoldersDoNotBelongTogether) {
  Given("node7", Role::kWorker);
  Given("node8", Role::kWorker);
  Copy(At("node8/key.pem"), At("node7/key.pem"));
  const std::string message = MessageAt("node7", absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(message, HasSubstr("node7/key.pem is not the key of"));
  EXPECT_THAT(message, Not(HasSubstr("PRIVATE")));

  ASSERT_TRUE(InitAuthority(At("other")).ok());
  Copy(At("other/crl.pem"), At("node8/crl.pem"));
  EXPECT_THAT(MessageAt("node8", absl::StatusCode::kInvalidArgument),
              HasSubstr("crl.pem is of another authority"));
  Copy(At("other/ca.pem"), At("node8/ca.pem"));
  EXPECT_THAT(MessageAt("node8", absl::StatusCode::kInvalidArgument),
              HasSubstr("cert.pem was not issued by the authority"));
}

TEST_F(CredentialsFolder, RenewalThatWasKilledBetweenItsRenamesIsWhole) {
  Given("node7", Role::kWorker);
  const std::string key = ReadText(At("node7/key.pem"));
  const Holder renewed = Given("node7", Role::kWorker);
  // As a kill after the first of the two renames leaves it.
  std::filesystem::rename(At("node7/key.pem"), At("node7/key.pem.new"));
  WriteText(At("node7/key.pem"), key);
  ASSERT_EQ(chmod(At("node7/key.pem").c_str(), 0600), 0);
  const auto read = ReadCredentials(At("node7"));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->holder.serial, renewed.serial);
  EXPECT_TRUE(BelongTogether(*read));
  // The first issue of all, killed at the same place.
  std::filesystem::remove(At("node7/key.pem"));
  EXPECT_TRUE(ReadCredentials(At("node7")).ok());
  // The next renewal leaves nothing behind.
  Given("node7", Role::kWorker);
  EXPECT_FALSE(std::filesystem::exists(At("node7/key.pem.new")));
  ASSERT_TRUE(ReadCredentials(At("node7")).ok());
}

TEST_F(CredentialsFolder, RenewalThatWasKilledBetweenItsRenamesIsFinished) {
  Given("head", Role::kServer);
  const std::string key = ReadText(At("head/key.pem"));
  EXPECT_TRUE(FinishRenewal(At("head")).ok());
  EXPECT_EQ(ReadText(At("head/key.pem")), key) << "nothing was to be done";

  std::filesystem::rename(At("head/key.pem"), At("head/key.pem.new"));
  WriteText(At("head/key.pem"), "the key before");
  ASSERT_TRUE(FinishRenewal(At("head")).ok());
  EXPECT_EQ(ReadText(At("head/key.pem")), key);
  EXPECT_FALSE(std::filesystem::exists(At("head/key.pem.new")));

  Given("other", Role::kServer);  // a draft whose certificate was not put in place
  Copy(At("other/key.pem"), At("head/key.pem.new"));
  std::filesystem::permissions(At("head/key.pem.new"), std::filesystem::perms(0600));
  EXPECT_TRUE(FinishRenewal(At("head")).ok());
  EXPECT_EQ(ReadText(At("head/key.pem")), key);
  EXPECT_TRUE(FinishRenewal(At("nowhere")).ok());
}

TEST_F(CredentialsFolder, ReadersDuringRenewalsMeetWholePairs) {
  Given("node7", Role::kWorker);
  std::atomic<bool> done = false;
  std::thread issuer([&] {
    for (int i = 0; i < 40; ++i) Given("node7", Role::kWorker);
    done = true;
  });
  int seen = 0;
  std::string serial;
  while (!done) {
    const auto read = ReadCredentials(At("node7"));
    EXPECT_TRUE(read.ok()) << read.status();
    if (!read.ok()) break;
    EXPECT_TRUE(BelongTogether(*read));
    if (read->holder.serial != serial) ++seen;
    serial = read->holder.serial;
  }
  issuer.join();
  EXPECT_GT(seen, 1) << "no renewal came between two readings";
}

TEST_F(CredentialsFolder, OwnCertificateIsShownWhileItIsValidAndNotRevoked) {
  const Holder holder = Given("head", Role::kServer);
  auto credentials = ReadCredentials(At("head"));
  ASSERT_TRUE(credentials.ok()) << credentials.status();
  EXPECT_TRUE(CheckOwn(*credentials, Now()).ok());
  EXPECT_THAT(std::string(CheckOwn(*credentials, holder.not_after_unix_s).message()),
              ::testing::HasSubstr("the certificate of head has expired on "));
  EXPECT_FALSE(CheckOwn(*credentials, holder.not_before_unix_s - 1).ok());
  ASSERT_TRUE(Revoke(ca(), "head").ok());
  credentials->crl_pem = ReadText(At("ca/crl.pem"));
  EXPECT_EQ(CheckOwn(*credentials, Now()).message().substr(0, 35),
            "the certificate of head was revoked");
}

TEST(DateOf, IsTheDayInUtc) {
  EXPECT_EQ(DateOf(1793577599), "2026-11-01");
  EXPECT_EQ(DateOf(1793577600), "2026-11-02");
}

}  // namespace
}  // namespace calib::access
