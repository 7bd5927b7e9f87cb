// A backup of a running server in one file, which is there once it is whole.
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/messages/backup_seal.h"
#include "server/report/text/people_units.h"

namespace calib::ctl {
namespace {

struct BackupOptions {
  std::string output;
};

void Declare(OptionList& list, BackupOptions& options) {
  list.Text("-o,--output", options.output,
            "FILE that holds all of it; an earlier backup there stays until this one is whole")
      .Required();
}

// A file that grows beside its place and is put there at the end. Goes with its object unless it
// was.
class BackupFile {
 public:
  explicit BackupFile(std::string path)
      : path_(std::move(path)), part_(absl::StrCat(path_, ".", getpid(), ".part")) {}
  ~BackupFile() {
    if (file_ >= 0) close(file_);
    if (!is_put_) unlink(part_.c_str());
  }
  BackupFile(const BackupFile&) = delete;
  BackupFile& operator=(const BackupFile&) = delete;

  absl::Status Begin() {
    if (file_ < 0) file_ = open(part_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    const bool is_empty = file_ >= 0 && ftruncate(file_, 0) == 0 && lseek(file_, 0, SEEK_SET) == 0;
    return is_empty ? absl::OkStatus() : Because();
  }
  absl::Status Add(const std::string& piece) const {
    for (std::size_t at = 0; at < piece.size();) {
      const ssize_t count = write(file_, piece.data() + at, piece.size() - at);
      if (count < 0 && errno != EINTR) return Because();
      at += count > 0 ? static_cast<std::size_t>(count) : 0;
    }
    return absl::OkStatus();
  }
  absl::Status Put() {
    if (fsync(file_) != 0 || std::rename(part_.c_str(), path_.c_str()) != 0) return Because();
    is_put_ = true;
    const std::string folder = std::filesystem::path(path_).parent_path().string();
    const int place = open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_CLOEXEC);
    const bool is_kept = place >= 0 && fsync(place) == 0;
    if (place >= 0) close(place);
    return is_kept ? absl::OkStatus() : Because();
  }

 private:
  absl::Status Because() const {
    return absl::PermissionDeniedError(
        absl::StrCat(path_, " cannot be written: ", std::generic_category().message(errno)));
  }

  const std::string path_, part_;
  int file_ = -1;
  bool is_put_ = false;
};

// Nothing but an earlier backup is written over: FILE may be the state of a server by mistake.
absl::Status CheckPlace(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return absl::OkStatus();
  if (std::filesystem::is_regular_file(path, error)) {
    std::ifstream file(path, std::ios::binary);
    std::string tail(static_cast<std::size_t>(messages::kSealBytes), '\0');
    file.seekg(-messages::kSealBytes, std::ios::end);
    file.read(tail.data(), messages::kSealBytes);
    if (file.good() && messages::ParseSeal(tail).has_value()) return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat(path, " exists and is no backup, and stays as it is: choose another name"));
}

absl::StatusOr<int> Backup(const CommonOptions& common, const BackupOptions& options) {
  RETURN_IF_ERROR(CheckPlace(options.output));
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  BackupFile file(options.output);
  ASSIGN_OR_RETURN(const messages::BackupSeal seal,
                   session->client().Backup(
                       {.begin = [&file] { return file.Begin(); },
                        .add = [&file](const std::string& piece) { return file.Add(piece); }}));
  RETURN_IF_ERROR(file.Add(messages::SealText(seal)));
  RETURN_IF_ERROR(file.Put());
  if (common.json) {
    std::cout << nlohmann::ordered_json{{"backup", options.output},
                                        {"bytes", seal.bytes},
                                        {"sha256", seal.digest}}
                     .dump(2)
              << "\n";
    return kDone;
  }
  std::cout << options.output << " holds all of it ("
            << report::Number(1e-6 * static_cast<double>(seal.bytes), 3)
            << " MB), looked through by SQLite; `calibd --restore " << options.output
            << " --state NEW` makes a state folder of it.\n";
  return kDone;
}

}  // namespace

Verb BackupVerb() {
  return MakeVerb<BackupOptions>({.name = "backup",
                                  .description = "All that a running server holds, in one file",
                                  .example = "backup -o calib.backup"},
                                 &Declare, &Backup);
}

}  // namespace calib::ctl
