#include "server/ctl/evaluation.h"

#include <google/protobuf/util/json_util.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/ctl/write_file.h"

namespace calib::ctl {
namespace {

constexpr int kRefusedCheckpoint = 3;  // of calib-worker --once

std::string ReadAll(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

absl::StatusOr<Evaluation> Evaluation::Start(const std::string& program, const Task& task,
                                             const std::string& folder) {
  if (task.program) return StartProgram(program, task, folder);
  std::string json;
  if (!google::protobuf::util::MessageToJsonString(task.spec, &json).ok()) {
    return absl::InternalError("the evaluation cannot be written as JSON");
  }
  RETURN_IF_ERROR(WriteFile(folder + "/spec.json", json));
  std::vector<std::string> arguments = {"--once",
                                        folder + "/spec.json",
                                        "-o",
                                        folder + "/states.csv",
                                        "--exit-with-parent",
                                        std::to_string(getpid())};
  if (!task.packing.empty()) {
    RETURN_IF_ERROR(WriteFile(folder + "/packing.txt", task.packing));
    arguments.insert(arguments.end(), {"--packing", folder + "/packing.txt"});
  }
  for (std::size_t m = 0; m < task.meshes.size(); ++m) {
    const std::string path = absl::StrCat(folder, "/mesh", m, ".stl");
    RETURN_IF_ERROR(WriteFile(path, task.meshes[m]));
    arguments.insert(arguments.end(), {"--mesh", path});
  }
  if (!task.checkpoint.empty()) {
    arguments.insert(arguments.end(), {"--checkpoint", task.checkpoint});
  }
  if (!task.vtk.empty()) arguments.insert(arguments.end(), {"--vtk", task.vtk});
  if (task.load_step) {
    arguments.insert(arguments.end(), {"--load-step", std::to_string(*task.load_step)});
  }
  ASSIGN_OR_RETURN(auto process, client::ChildProcess::Start(program, arguments, folder + "/log"));
  return Evaluation(std::move(process), folder);
}

absl::StatusOr<Evaluation> Evaluation::StartProgram(const std::string& program, const Task& task,
                                                    const std::string& folder) {
  RETURN_IF_ERROR(WriteFile(folder + "/run.bin", task.program->SerializeAsString()));
  std::error_code error;
  std::filesystem::create_directories(folder + "/files", error);
  for (const auto& [digest, content] : task.files) {
    RETURN_IF_ERROR(WriteFile(absl::StrCat(folder, "/files/", digest), content));
  }
  const std::vector<std::string> arguments = {
      "--once-program",     folder + "/run.bin",     "--files", folder + "/files",
      "--report",           folder + "/report.json", "-o",      folder + "/states.csv",
      "--exit-with-parent", std::to_string(getpid())};
  ASSIGN_OR_RETURN(auto process, client::ChildProcess::Start(program, arguments, folder + "/log"));
  return Evaluation(std::move(process), folder);
}

std::string Evaluation::Report() const { return ReadAll(folder_ + "/report.json"); }

int Evaluation::StatesSoFar() const {
  const std::string table = Table();
  return std::max(0, static_cast<int>(std::count(table.begin(), table.end(), '\n')) - 1);
}

std::string Evaluation::Table() const { return ReadAll(folder_ + "/states.csv"); }

absl::Status Evaluation::Result() {
  const int code = process_.Wait();
  if (code == 0) return absl::OkStatus();
  std::string said = ReadAll(folder_ + "/log");
  said = std::string(absl::StripAsciiWhitespace(said));
  if (code == 1) return absl::AbortedError(said.empty() ? "the model diverged" : said);
  if (code == kRefusedCheckpoint) return absl::InvalidArgumentError(said);
  return absl::InternalError(said.empty() ? absl::StrCat("calib-worker ended with status ", code)
                                          : said);
}

}  // namespace calib::ctl
