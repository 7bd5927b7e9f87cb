#include "worker/engine/checkpoints.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "dem/simulate/whole_file.h"
#include "proto/rpc/random_id.h"

namespace calib::worker {
namespace {

namespace fs = std::filesystem;

constexpr const char* kEnding = ".checkpoint";
constexpr std::string_view kMagic = "calib held run 1\n";

std::string ReadAll(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Of two processes that open a new folder at the same time one gives it its identity.
std::string IdentityOf(const std::string& folder) {
  const std::string path = folder + "/identity";
  const std::string own = absl::StrCat(path, ".", getpid());
  if (std::string identity = ReadAll(path); !identity.empty()) return identity;
  std::ofstream file(own);
  file << rpc::RandomId();
  file.close();  // tells whether the disk has taken it
  if (file) {
    // Fails where there is one already, which then counts.
    [[maybe_unused]] const int linked = link(own.c_str(), path.c_str());
  }
  std::error_code ignored;
  fs::remove(own, ignored);
  return ReadAll(path);
}

}  // namespace

Checkpoints::Checkpoints(std::string folder, std::string identity, std::int64_t most_bytes)
    : folder_(std::move(folder)), identity_(std::move(identity)), most_bytes_(most_bytes) {}

absl::StatusOr<Checkpoints> Checkpoints::Open(const std::string& folder, std::int64_t most_bytes) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    return absl::UnavailableError(absl::StrCat(folder, ": cannot be made: ", error.message()));
  }
  std::string identity = IdentityOf(folder);
  if (identity.empty()) {
    return absl::UnavailableError(absl::StrCat(folder, ": cannot be written"));
  }
  Checkpoints checkpoints(folder, std::move(identity), most_bytes);
  checkpoints.MakeRoom();
  return checkpoints;
}

std::string Checkpoints::PathOf(const std::string& run) const {
  return absl::StrCat(folder_, "/", run, kEnding);
}

std::optional<HeldRun> Checkpoints::Find(const std::string& run) const {
  const std::string path = PathOf(run);
  const std::string bytes = ReadAll(path);
  HeldRun held;
  const std::size_t head = kMagic.size() + sizeof held.steps + sizeof held.contact_updates;
  if (bytes.size() < head || !absl::StartsWith(bytes, std::string(kMagic))) return std::nullopt;
  std::memcpy(&held.steps, bytes.data() + kMagic.size(), sizeof held.steps);
  std::memcpy(&held.contact_updates, bytes.data() + kMagic.size() + sizeof held.steps,
              sizeof held.contact_updates);
  held.checkpoint = bytes.substr(head);
  std::error_code ignored;
  fs::last_write_time(path, fs::file_time_type::clock::now(), ignored);  // in use
  return held;
}

absl::Status Checkpoints::Save(const std::string& run, const HeldRun& held) const {
  std::string bytes(kMagic);
  bytes.append(reinterpret_cast<const char*>(&held.steps), sizeof held.steps);
  bytes.append(reinterpret_cast<const char*>(&held.contact_updates), sizeof held.contact_updates);
  bytes += held.checkpoint;
  absl::Status status = dem::WriteWholeFile(PathOf(run), bytes);
  MakeRoom();
  return status;
}

void Checkpoints::Remove(const std::string& run) const {
  std::error_code ignored;
  fs::remove(PathOf(run), ignored);
}

void Checkpoints::MakeRoom() const {
  struct File {
    fs::file_time_type used;
    fs::path path;
    std::int64_t bytes;
  };
  std::vector<File> files;
  std::int64_t all = 0;
  std::error_code error;
  for (fs::directory_iterator it(folder_, error), end; !error && it != end; it.increment(error)) {
    std::error_code gone;  // another process may have removed it
    const File file{.used = it->last_write_time(gone),
                    .path = it->path(),
                    .bytes = static_cast<std::int64_t>(it->file_size(gone))};
    if (!gone && file.path.extension() == kEnding) {
      files.push_back(file);
      all += file.bytes;
    }
  }
  std::sort(files.begin(), files.end(),
            [](const File& a, const File& b) { return a.used < b.used; });
  const auto oldest = fs::file_time_type::clock::now() - kLongestUnused;
  for (const File& file : files) {
    if (all <= most_bytes_ && file.used >= oldest) return;
    fs::remove(file.path, error);
    all -= file.bytes;
  }
}

}  // namespace calib::worker
