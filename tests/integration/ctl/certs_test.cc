// calibctl certs as a user meets it.
#include <gmock/gmock.h>

#include <algorithm>
#include <ctime>

#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class Certs : public CalibctlFixture {
 protected:
  Certs() { EXPECT_EQ(Call("certs init ca").code, 0) << Read("err"); }
  /// Refused as bad input, with so many sentences.
  std::string Refused(const std::string& arguments, std::ptrdiff_t sentences) const {
    const Answer answer = Call("certs " + arguments);
    EXPECT_EQ(answer.code, 2) << arguments << answer.err;
    EXPECT_EQ(std::count(answer.err.begin(), answer.err.end(), '\n'), sentences) << answer.err;
    EXPECT_EQ(answer.out, "");
    return answer.err;
  }
};

TEST_F(Certs, AnAuthorityIssuesRenewsAndRevokes) {
  const Json head =
      Call("certs issue ca --role server --host node1 --host 10.0.0.7 head -o head --json").json();
  EXPECT_EQ(head["name"], "head");
  EXPECT_EQ(head["role"], "server");
  EXPECT_EQ(head["folder"], "head");
  EXPECT_EQ(head["hosts"], Json({"node1", "10.0.0.7", "localhost", "127.0.0.1", "::1"}));
  const auto days = [](const Json& answer) {
    return (answer["not_after_unix_s"].get<double>() - static_cast<double>(std::time(nullptr))) /
           86400;
  };
  EXPECT_NEAR(days(head), 365, 0.1);
  for (const Json& path : head["written"]) {
    EXPECT_TRUE(std::filesystem::exists(work_ / path.get<std::string>())) << path;
  }
  const Json renewed = Call("certs issue ca --role server head -o head --days 90 --json").json();
  EXPECT_NEAR(days(renewed), 90, 0.1);
  EXPECT_EQ(renewed["hosts"], head["hosts"]);
  EXPECT_NE(renewed["serial"], head["serial"]);

  const Answer worker = Call("certs issue ca --role worker node7 -o node7");
  EXPECT_EQ(worker.code, 0) << worker.err;
  EXPECT_THAT(worker.out, AllOf(HasSubstr("of node7 (worker), valid until "),
                                HasSubstr("calib-worker --tls node7"), Not(HasSubstr("PRIVATE"))));
  const Answer revoked = Call("certs revoke ca node7");
  EXPECT_EQ(revoked.code, 0) << revoked.err;
  EXPECT_THAT(revoked.out, AllOf(HasSubstr("1 certificate of node7 revoked in ca/crl.pem"),
                                 HasSubstr("copy ca/crl.pem into the folder")));
  EXPECT_EQ(Call("certs revoke ca node7 --json").json(),
            Json({{"name", "node7"}, {"revoked", 0}, {"written", Json::array()}}));
  const Json other = Call("certs init other/ca --json").json();
  EXPECT_EQ(other["authority"], "other/ca");
  EXPECT_NEAR(days(other), 3653, 0.1);
}

TEST_F(Certs, BadInputIsTwoWithOneLinePerProblem) {
  EXPECT_THAT(Refused("make ca", 1), HasSubstr("\"make\" is none of init, issue, revoke"));
  Refused("issue ca", 3);
  Refused("issue ca --role king 'a b' -o x", 1);
  Refused("issue ca --role worker 'a b' --host h --days 4000 -o x", 3);
  EXPECT_THAT(Refused("issue nowhere --role worker n -o x", 1),
              HasSubstr("calibctl certs init nowhere"));
  Refused("init other name --days 3", 2);
  Refused("revoke ca", 1);
  Refused("revoke ca nobody", 1);
  EXPECT_FALSE(std::filesystem::exists(work_ / "x"));
  EXPECT_FALSE(std::filesystem::exists(work_ / "other"));
  EXPECT_EQ(Call("certs issue ca --role worker n -o n --days few").code, 2);
}

TEST_F(Certs, RefusalsAreOneAndChangeNothing) {
  const std::string key = Read("ca/ca-key.pem");
  const Answer again = Call("certs init ca");
  EXPECT_EQ(again.code, 1);
  EXPECT_THAT(again.err, HasSubstr("ca holds an authority already"));
  EXPECT_EQ(Read("ca/ca-key.pem"), key);
  ASSERT_EQ(Call("certs issue ca --role viewer anna -o anna").code, 0);
  const std::string cert = Read("anna/cert.pem");
  EXPECT_EQ(Call("certs issue ca --role operator anna -o elsewhere").code, 1);
  EXPECT_EQ(Call("certs issue ca --role viewer bob -o anna").code, 1);
  EXPECT_EQ(Read("anna/cert.pem"), cert);
  EXPECT_FALSE(std::filesystem::exists(work_ / "elsewhere"));
}

}  // namespace
}  // namespace calib::ctl
