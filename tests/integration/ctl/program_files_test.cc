// Files of a user's program that stay with its runs, and the verb that brings them.
#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

constexpr char kKeepingCode[] = R"(import json, os, sys
request = json.loads(sys.stdin.readline())
os.mkdir("out")
for k, at in enumerate(request["control"]["values"]):
    print(json.dumps({"load_step": k, "y": request["parameters"]["a"] * at}), flush=True)
with open("out/dump.vtk", "w") as dump:
    print("slope", repr(request["parameters"]["a"]), file=dump)
)";

constexpr char kCampaign[] = R"(name: line
model:
  command: [/usr/bin/python3, code.py]
  files: [code.py]
  keep: [out/dump.vtk, never.log]
parameters:
  a: {prior: uniform, min: 0, max: 3}
experiments:
  - name: line
    data: {file: line.csv}
    control: x
    observables: {y: {noise: {absolute: 0.1}}}
inference: {method: sqmc, samples: 8}
seed: 3
)";

class ProgramFiles : public CalibctlFixture {};

TEST_F(ProgramFiles, StayWithTheirRunsAndAreBrought) {
  Write("code.py", kKeepingCode);
  Write("line.csv", "x,y\n1,2\n2,4.1\n3,5.9\n");
  Write("model.yaml", kCampaign);
  ASSERT_EQ(Call("run model.yaml --state s --workers 1 --json").code, 0) << Read("err");
  const Json sample = Call("samples c1 --state s --json").json()["samples"][3];
  EXPECT_EQ(sample["status"], "finished");
  ASSERT_EQ(sample["kept"].size(), 2U) << sample.dump();
  EXPECT_EQ(sample["kept"][0]["name"], "never.log");
  EXPECT_EQ(sample["kept"][0]["digest"], nullptr);
  const Answer kept = Call("kept c1 3 -o files --state s --json");
  ASSERT_EQ(kept.code, 0) << kept.err;
  const Json files = kept.json()["kept"];
  EXPECT_EQ(files[0]["reason"], "is not there");
  EXPECT_EQ(files[0]["file"], nullptr);
  EXPECT_EQ(files[1]["file"], "files/line/out/dump.vtk");
  const std::string dump = Read("files/line/out/dump.vtk");
  ASSERT_EQ(dump.substr(0, 6), "slope ");
  EXPECT_EQ(std::stod(dump.substr(6)), sample["parameters"]["a"].get<double>());
  EXPECT_NE(Call("kept c1 99 --state s").code, 0);
  const Answer names = Call("kept c1 3 --state s");
  EXPECT_NE(names.out.find("line: out/dump.vtk"), std::string::npos) << names.out;
  EXPECT_NE(names.out.find("never.log did not stay: is not there"), std::string::npos) << names.out;
}

}  // namespace
}  // namespace calib::ctl
