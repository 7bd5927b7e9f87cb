#include "server/service/spool.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace calib::service {
namespace {

absl::Status CannotKeep(int error) {
  return absl::ResourceExhaustedError(absl::StrCat(
      "the server cannot keep the file beside its state: ", std::generic_category().message(error),
      "; send it again when there is room"));
}

}  // namespace

absl::StatusOr<std::unique_ptr<Spool>> Spool::Open(const std::string& folder, std::int64_t most) {
  std::string name = folder + "/upload-XXXXXX";
  const int file = mkostemp(name.data(), O_CLOEXEC);
  if (file < 0) {
    return CannotKeep(errno);
  }
  unlink(name.c_str());  // it goes with this process, however that ends
  return std::unique_ptr<Spool>(new Spool(file, most));
}

Spool::~Spool() { close(file_); }

absl::Status Spool::Add(const v1::BlobChunk& chunk) {
  if (digest_.empty()) {
    digest_ = chunk.digest();
  }
  if (digest_.empty()) {
    return absl::InvalidArgumentError("the first chunk of a blob must carry its digest");
  }
  const std::string& data = chunk.data();
  if (bytes_ + static_cast<std::int64_t>(data.size()) > most_) {
    return absl::ResourceExhaustedError(absl::StrCat("blob ", digest_, " is larger than the ",
                                                     most_,
                                                     " bytes that the server takes (calibd "
                                                     "--max-blob-mib)"));
  }
  for (std::size_t written = 0; written < data.size();) {
    const ssize_t count = pwrite(file_, data.data() + written, data.size() - written,
                                 bytes_ + static_cast<std::int64_t>(written));
    if (count < 0 && errno != EINTR) {
      return CannotKeep(errno);
    }
    written += count > 0 ? static_cast<std::size_t>(count) : 0;
  }
  found_.Update(data);
  bytes_ += static_cast<std::int64_t>(data.size());
  return absl::OkStatus();
}

absl::Status Spool::Finish() {
  if (digest_.empty()) {
    return absl::InvalidArgumentError("an empty stream is no blob");
  }
  if (const std::string found = found_.Finish(); found != digest_) {
    return absl::InvalidArgumentError(
        absl::StrCat("content has SHA-256 ", found, " but was sent as ", digest_));
  }
  return absl::OkStatus();
}

bool Spool::Read(std::int64_t from, std::span<char> to) const {
  while (!to.empty()) {
    const ssize_t count = pread(file_, to.data(), to.size(), from);
    if (count == 0 || (count < 0 && errno != EINTR)) {
      return false;
    }
    if (count > 0) {
      from += count;
      to = to.subspan(static_cast<std::size_t>(count));
    }
  }
  return true;
}

}  // namespace calib::service
