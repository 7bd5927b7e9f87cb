// `calibctl simulate --checkpoint` killed and begun again: the same table as without a kill.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "tests/support/process.h"
#include "tests/support/sixty_four_grains.h"

namespace calib::testing {
namespace {

constexpr std::chrono::minutes kLong{2};
constexpr int kLoadSteps = 60;

class SimulationKilled : public ::testing::Test {
 protected:
  SimulationKilled() : folder_(FreshFolder("simulation-killed")) {
    std::ofstream data(folder_ + "/data.csv");
    data << "axial_strain,q_over_p\n";
    for (int k = 1; k <= kLoadSteps; ++k) data << 0.001 * k << ",1\n";
    std::ofstream(folder_ + "/sand.yaml")
        << SixtyFourGrains("{q_over_p: {noise: {absolute: 0.3}}}", 6, 2);
  }
  ~SimulationKilled() override { std::filesystem::remove_all(folder_); }

  std::string In(const std::string& name) const { return folder_ + "/" + name; }

  Process Simulate(const std::string& output, const std::string& friction,
                   const std::vector<std::string>& more) const {
    std::vector<std::string> argv = {Program("calibctl"),
                                     "simulate",
                                     In("sand.yaml"),
                                     "--set",
                                     "young_modulus=3e8 Pa",
                                     "--set",
                                     "friction_coefficient=" + friction,
                                     "-o",
                                     In(output)};
    argv.insert(argv.end(), more.begin(), more.end());
    return {argv, In("log")};
  }

  const std::string folder_;
};

TEST_F(SimulationKilled, GoesOnFromTheLastLoadStepToTheSameBits) {
  ASSERT_EQ(Simulate("whole.csv", "0.5", {}).Wait(kLong), 0) << ReadAll(In("log"));
  const std::string checkpoint = In("kept/tx.checkpoint");
  {
    Process first = Simulate("killed.csv", "0.5", {"--checkpoint", In("kept")});
    ASSERT_TRUE(Eventually(kLong, [&] { return std::filesystem::exists(checkpoint); }))
        << ReadAll(In("log"));
    ASSERT_TRUE(first.Running());
    first.Kill();
  }
  EXPECT_FALSE(std::filesystem::exists(In("killed.csv")));
  ASSERT_EQ(
      Simulate("resumed.csv", "0.5", {"--checkpoint", In("kept"), "--vtk", In("vtk")}).Wait(kLong),
      0)
      << ReadAll(In("log"));
  const std::string whole = ReadAll(In("whole.csv"));
  EXPECT_EQ(std::count(whole.begin(), whole.end(), '\n'), kLoadSteps + 1);
  EXPECT_EQ(ReadAll(In("resumed.csv")), whole);
  // What was there before the kill has not been made again.
  EXPECT_FALSE(std::filesystem::exists(In("vtk/tx/grains_0000.vtu")));
  EXPECT_TRUE(std::filesystem::exists(In("vtk/tx/grains_0059.vtu")));
}

TEST_F(SimulationKilled, ACheckpointThatDoesNotFitIsRefusedAndStays) {
  const std::string checkpoint = In("kept/tx.checkpoint");
  ASSERT_EQ(Simulate("whole.csv", "0.5", {"--checkpoint", In("kept")}).Wait(kLong), 0);
  const std::string kept = ReadAll(checkpoint);
  std::filesystem::remove(In("log"));
  EXPECT_EQ(Simulate("other.csv", "0.6", {"--checkpoint", In("kept")}).Wait(kLong), 2);
  EXPECT_THAT(ReadAll(In("log")),
              ::testing::EndsWith(
                  "calibctl: " + checkpoint +
                  ": the checkpoint belongs to another run; what differs: parameters; without this "
                  "file the run starts from the beginning\n"));
  EXPECT_EQ(ReadAll(checkpoint), kept);
  EXPECT_FALSE(std::filesystem::exists(In("other.csv")));

  std::filesystem::resize_file(checkpoint, kept.size() - 100);
  std::filesystem::remove(In("log"));
  EXPECT_EQ(Simulate("other.csv", "0.5", {"--checkpoint", In("kept")}).Wait(kLong), 2);
  EXPECT_THAT(ReadAll(In("log")),
              ::testing::EndsWith("calibctl: " + checkpoint +
                                  ": the checkpoint is damaged or cut off; without this file the "
                                  "run starts from the beginning\n"));
  EXPECT_EQ(std::filesystem::file_size(checkpoint), kept.size() - 100);
}

}  // namespace
}  // namespace calib::testing
