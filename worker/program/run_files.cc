#include "worker/program/run_files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "worker/program/scratch.h"

namespace calib::worker {
namespace {

constexpr std::size_t kPieceOfFile = std::size_t{64} << 10;
constexpr off_t kMostOfALook = off_t{4} << 20;

/// A regular file that is opened for reading; -1 with a reason, "" where nothing has this name.
int OpenRegular(const std::string& path, std::string& why) {
  // A fifo would block, a link may lead anywhere.
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW);
  if (file < 0) {
    why = errno == ENOENT ? "" : std::strerror(errno);
    return -1;
  }
  struct stat found {};
  if (fstat(file, &found) != 0 || !S_ISREG(found.st_mode)) {
    close(file);
    why = "is no regular file";
    return -1;
  }
  return file;
}

}  // namespace

TableFile::TableFile(const std::string& folder, std::string name, TableReader& reader)
    : name_(std::move(name)), path_(absl::StrCat(folder, "/", name_)), reader_(reader) {}

bool TableFile::Poll() {
  std::string why;
  const int file = OpenRegular(path_, why);
  is_there_ = file >= 0;
  if (file < 0) {
    if (!why.empty()) reader_.Fail(absl::StrCat(name_, " ", why));
    return true;
  }
  struct stat found {};
  fstat(file, &found);
  if (found.st_size < at_) {
    reader_.Fail(absl::StrCat(name_, " has become shorter: it has to grow by a row per load step"));
  }
  std::vector<char> piece(kPieceOfFile);
  bool at_end = false;
  for (const off_t most = at_ + kMostOfALook; at_ < most && !reader_.end().has_value();) {
    const ssize_t got = pread(file, piece.data(), piece.size(), at_);
    at_end = got <= 0;
    if (at_end) break;
    at_ += got;
    reader_.Add({piece.data(), static_cast<std::size_t>(got)});
  }
  close(file);
  return at_end || reader_.end().has_value();
}

void ReadKeptFiles(const std::vector<std::string>& names, const std::string& folder,
                   std::vector<KeptContent>& kept, std::map<std::string, std::string>& not_kept) {
  for (const std::string& name : names) {
    std::string why;
    const int file =
        CheckFileName(name).ok() ? OpenRegular(absl::StrCat(folder, "/", name), why) : -1;
    if (file < 0) {
      if (!CheckFileName(name).ok()) why = "is no name of a file of the scratch folder";
      not_kept[name] = why.empty() ? "is not there" : why;
      continue;
    }
    std::string content;
    std::vector<char> piece(kPieceOfFile);
    for (ssize_t got = 1; got > 0 && static_cast<std::int64_t>(content.size()) <= kMostKeptBytes;) {
      got = read(file, piece.data(), piece.size());
      if (got > 0) content.append(piece.data(), static_cast<std::size_t>(got));
    }
    close(file);
    if (static_cast<std::int64_t>(content.size()) > kMostKeptBytes) {
      not_kept[name] = absl::StrCat("is larger than ", kMostKeptBytes / 1'000'000, " MB");
    } else {
      kept.push_back({.name = name, .content = std::move(content)});
    }
  }
}

}  // namespace calib::worker
