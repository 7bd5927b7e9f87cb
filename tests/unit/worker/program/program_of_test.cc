#include "tests/unit/worker/program/program_of_test.h"

#include <signal.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "proto/rpc/digest.h"

namespace calib::worker::testing {

TemporaryFolder::TemporaryFolder() {
  std::string name = ::testing::TempDir() + "/program_testXXXXXX";
  path_ = std::filesystem::canonical(mkdtemp(name.data()));
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::string Contents::Add(const std::string& content) {
  const std::string digest = rpc::Sha256Hex(content);
  contents_[digest] = content;
  return digest;
}

Fetch Contents::AsFetch() {
  return [this](const std::string& digest, std::stop_token) -> absl::StatusOr<std::string> {
    ++fetches_;
    const auto found = contents_.find(digest);
    if (found == contents_.end()) return absl::UnavailableError("no server");
    return found->second;
  };
}

v1::ProgramRun ProgramsTest::Shell(const std::string& script, int load_steps) {
  v1::ProgramRun run;
  for (const std::string& word : {std::string("sh"), std::string("-c"), script}) {
    run.add_command(word);
  }
  run.set_experiment("a");
  run.add_observables("y");
  run.set_control("x");
  for (int k = 0; k < load_steps; ++k) run.add_control_values(0.1 * k);
  return run;
}

v1::ProgramRun ProgramsTest::Python(const std::string& script, int load_steps) {
  v1::ProgramRun run = Shell("", load_steps);
  run.clear_command();
  run.add_command("python3");
  run.add_command("model.py");
  Bring(run, "model.py", script);
  return run;
}

void ProgramsTest::Bring(v1::ProgramRun& run, const std::string& name, const std::string& content) {
  v1::ProgramFile& file = *run.add_files();
  file.set_name(name);
  file.set_digest(contents_.Add(content));
}

Programs& ProgramsTest::TheseMay(std::vector<std::string> allowed) {
  programs_ = std::make_unique<Programs>(ProgramsOptions{.fetch = contents_.AsFetch(),
                                                         .put = put_,
                                                         .scratch = folder_.path() + "/scratch",
                                                         .allowed = std::move(allowed),
                                                         .slots = slots_,
                                                         .path = {},
                                                         .times = times_});
  return *programs_;
}

Outcome ProgramsTest::Evaluate(const v1::ProgramRun& run, std::stop_token stop) {
  if (programs_ == nullptr) TheseMay({"sh", "python3"});
  Outcome outcome;
  const auto begin = std::chrono::steady_clock::now();
  outcome.finished = programs_->Evaluate(
      run, ++attempt_, [&](v1::State state) { outcome.states.push_back(std::move(state)); }, stop,
      &outcome.report);
  outcome.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  EXPECT_EQ(outcome.finished.states(), static_cast<std::int64_t>(outcome.states.size()));
  return outcome;
}

std::string Answers(int begin, int end) {
  std::string lines;
  for (int k = begin; k < end; ++k) {
    lines += "echo '{\"load_step\": " + std::to_string(k) + ", \"y\": " + std::to_string(10 * k) +
             "}'\n";
  }
  return lines;
}

bool IsAlive(pid_t pid) {
  std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
  std::string text;
  std::getline(stat, text);
  return !text.empty() && text.find(") Z") == std::string::npos;
}

bool EndsSoon(pid_t pid) {
  for (int k = 0; k < 100 && IsAlive(pid); ++k) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return !IsAlive(pid);
}

}  // namespace calib::worker::testing
