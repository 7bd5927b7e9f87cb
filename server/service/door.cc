#include "server/service/door.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "proto/rpc/check_message.h"

namespace calib::service {
namespace {

constexpr std::chrono::minutes kSaidAgain{1};
/// Reasons remembered so as not to be said again. Chosen: some times the fields there are.
constexpr std::size_t kRemembered = 1000;

/// A peer without its port: who comes again over another connection is the same.
std::string AddressOf(const std::string& peer) {
  const std::size_t port = peer.rfind(':');
  return peer.starts_with("ipv") && port != std::string::npos ? peer.substr(0, port) : peer;
}

/// What a sentence is about: its first two words, the field among them, without the numbers of
/// entries.
std::string SubjectOf(const std::string& sentence) {
  std::string subject;
  int blanks = 0;
  bool in_brackets = false;
  for (const char c : sentence) {
    blanks += c == ' ' ? 1 : 0;
    if (blanks == 2) break;
    in_brackets = (in_brackets || c == '[') && c != ']';
    if (!in_brackets) subject += c;
  }
  return subject;
}

}  // namespace

absl::StatusOr<Door::Pass> Door::Enter(const std::string& peer) { return Count(peer, false); }

absl::StatusOr<Door::Pass> Door::EnterWithBlob(const std::string& peer) {
  return Count(peer, true);
}

absl::StatusOr<Door::Pass> Door::Count(const std::string& peer, bool with_blob) {
  std::string why;
  {
    absl::MutexLock lock(&mutex_);
    Open& open = open_[peer];
    // All who come over a socket have one name; each connection keeps gRPC's own bound (server.cc).
    const bool is_one = !peer.starts_with("unix:");
    if (is_one && open.calls >= limits_.streams_per_peer) {
      why = absl::StrCat("this connection has ", open.calls,
                         " calls open, and the server takes no more of one (calibd "
                         "--max-streams-per-peer)");
    } else if (is_one && with_blob && open.blobs >= limits_.blobs_per_peer) {
      why = absl::StrCat("this connection has ", open.blobs,
                         " files on their way, and the server takes no more of one (calibd "
                         "--max-blobs-per-peer): try again when one has ended");
    } else if (with_blob && blobs_ >= limits_.blobs) {
      why = absl::StrCat(blobs_,
                         " files are on their way to and from the server, which takes no more "
                         "(calibd --max-blobs): try again when one has ended");
    } else {
      ++open.calls;
      open.blobs += with_blob ? 1 : 0;
      blobs_ += with_blob ? 1 : 0;
    }
    if (open.calls == 0) {
      open_.erase(peer);
    }
  }
  if (!why.empty()) {
    const absl::Status status = absl::ResourceExhaustedError(why);
    LogRefusal(peer, status);
    return status;
  }
  return Pass(this, [this, peer, with_blob](const void*) { Leave(peer, with_blob); });
}

void Door::Leave(const std::string& peer, bool with_blob) {
  absl::MutexLock lock(&mutex_);
  Open& open = open_[peer];
  open.blobs -= with_blob ? 1 : 0;
  blobs_ -= with_blob ? 1 : 0;
  if (--open.calls == 0) {
    open_.erase(peer);
  }
}

absl::Status Door::Check(const std::string& peer, const google::protobuf::Message& message) {
  absl::Status status = rpc::CheckMessage(message);
  if (!status.ok()) {
    LogRefusal(peer, status);
  }
  return status;
}

void Door::LogRefusal(const std::string& peer, const absl::Status& why) {
  const Clock::time_point now = Clock::now();
  const std::string sentence(why.message());
  {
    absl::MutexLock lock(&mutex_);
    const auto [said, is_new] =
        said_.try_emplace(absl::StrCat(AddressOf(peer), " ", SubjectOf(sentence)), now);
    if (!is_new && now - said->second < kSaidAgain) {
      return;
    }
    said->second = now;
    if (said_.size() > kRemembered) {
      said_.erase(std::min_element(said_.begin(), said_.end(), [](const auto& a, const auto& b) {
        return a.second < b.second;
      }));
    }
  }
  spdlog::warn("refused peer={} reason=\"{}\"", peer, sentence);
}

}  // namespace calib::service
