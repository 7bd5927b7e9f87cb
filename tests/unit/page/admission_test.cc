#include "server/page/admission.h"

#include <gtest/gtest.h>

namespace calib::page {
namespace {

const std::string kToken(64, 'a');

std::unique_ptr<Admission> Make(int port) {
  auto admission = Admission::Open(kToken, "").value();
  admission->SetPort(port);
  return admission;
}

absl::Status With(const Admission& admission, const std::string& authorization,
                  const std::string& cookie) {
  return admission.Admit({.authorization = authorization, .cookie = cookie});
}

TEST(Admission, WantsTheTokenOrItsCookie) {
  const auto admission = Make(80);
  EXPECT_TRUE(With(*admission, "Bearer " + kToken, "").ok());
  EXPECT_TRUE(With(*admission, "bearer " + kToken, "").ok());
  const std::vector<std::string> wrongs = {
      "", kToken, "Bearer ", "Bearer x" + kToken, "Bearer " + kToken.substr(1), "Basic " + kToken};
  for (const std::string& wrong : wrongs) {
    EXPECT_TRUE(absl::IsUnauthenticated(With(*admission, wrong, ""))) << wrong;
  }
  EXPECT_TRUE(absl::IsUnauthenticated(With(*admission, "", "calib-80=" + kToken)))
      << "the cookie is not the token";
}

TEST(Admission, GivesACookieForTheRightTokenThatOpensThePageOfItsPortAlone) {
  const auto admission = Make(80);
  EXPECT_EQ(admission->CookieFor(ParseTarget("/?token=x").value()), std::nullopt);
  EXPECT_EQ(admission->CookieFor(ParseTarget("/").value()), std::nullopt);
  const auto set = admission->CookieFor(ParseTarget("/?token=" + kToken).value());
  ASSERT_TRUE(set.has_value());
  for (const char* part : {"; HttpOnly", "; SameSite=Strict", "; Path=/"}) {
    EXPECT_NE(set->find(part), std::string::npos) << *set;
  }
  EXPECT_EQ(set->find("Secure"), std::string::npos) << "plain text";
  EXPECT_EQ(set->find(kToken), std::string::npos);
  const std::string cookie = set->substr(0, set->find(';'));
  EXPECT_TRUE(With(*admission, "", cookie).ok());
  EXPECT_TRUE(With(*admission, "", "other=1; " + cookie).ok());
  EXPECT_FALSE(With(*Make(81), "", cookie).ok());
}

TEST(Host, OfThisMachineIsKnownByItsNames) {
  for (const char* host : {"localhost", "127.0.0.1", "127.1.2.3", "[::1]"}) {
    EXPECT_TRUE(IsNameOfThisMachine(host)) << host;
  }
  for (const char* host : {"", "unix", "evil.example", "localhost.evil.example", "10.0.0.1",
                           "127.0.0.1.evil.example", "[::2]", "0.0.0.0"}) {
    EXPECT_FALSE(IsNameOfThisMachine(host)) << host;
  }
}

}  // namespace
}  // namespace calib::page
