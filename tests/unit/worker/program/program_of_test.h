#pragma once
// Small programs as models: what tests of programs share.

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <map>
#include <string>
#include <vector>

#include "worker/program/programs.h"

namespace calib::worker::testing {

/// A folder that goes with the test.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// Contents by digest, as a server has them.
class Contents {
 public:
  /// Its digest.
  std::string Add(const std::string& content);
  Fetch AsFetch();
  int fetches() const { return fetches_; }

 private:
  std::map<std::string, std::string> contents_;
  std::atomic<int> fetches_ = 0;
};

/// What came of a run.
struct Outcome {
  v1::Finished finished;
  std::vector<v1::State> states;
  ProgramReport report;
  double seconds = 0;
};

/// Programs with a scratch folder and files of their own, and short times.
class ProgramsTest : public ::testing::Test {
 protected:
  /// An observable "y" and so many load steps; the command is `sh -c SCRIPT`.
  static v1::ProgramRun Shell(const std::string& script, int load_steps = 3);
  /// The same of a Python script, which is brought along.
  v1::ProgramRun Python(const std::string& script, int load_steps = 3);
  void Bring(v1::ProgramRun& run, const std::string& name, const std::string& content);
  /// Of the Programs, made at the first call with `options_`.
  Outcome Evaluate(const v1::ProgramRun& run, std::stop_token stop = {});
  Programs& TheseMay(std::vector<std::string> allowed);

  TemporaryFolder folder_;
  Contents contents_;
  ProgramTimes times_{.to_end = std::chrono::milliseconds(1000),
                      .grace = std::chrono::milliseconds(500),
                      .between_walks = std::chrono::milliseconds(50)};
  int slots_ = 1;
  Put put_{};  ///< empty: files of a run go
  std::int64_t attempt_ = 0;
  std::unique_ptr<Programs> programs_;
};

/// Lines of an answer with y = 10 * load step, from `begin` to before `end`, as `sh` prints them.
std::string Answers(int begin, int end);

bool IsAlive(pid_t pid);
/// Waits up to two seconds.
bool EndsSoon(pid_t pid);

}  // namespace calib::worker::testing
