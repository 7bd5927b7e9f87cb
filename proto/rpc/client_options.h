#pragma once
// How every client of this program opens a channel and bounds a call.

#include <chrono>
#include <memory>
#include <string>

namespace grpc {
class Channel;
class ClientContext;
}  // namespace grpc

namespace calib::rpc {

/// A question that is answered from the store takes well under a second; this is for a full disk or
/// a machine that swaps.
inline constexpr std::chrono::seconds kUnaryDeadline{30};
/// For calls that carry a file of at most kLargestBlob (chunking.h).
inline constexpr std::chrono::seconds kBlobDeadline{120};

/// Plain-text channel with quick reconnects (at most 2 s between tries) and keep-alive pings, so
/// that a peer which vanished without closing its socket is noticed. Never shared with other
/// channels to the same address.
std::shared_ptr<grpc::Channel> OpenChannel(const std::string& address);

/// The call fails with DEADLINE_EXCEEDED this long from now.
void SetDeadline(grpc::ClientContext& context, std::chrono::milliseconds from_now);

}  // namespace calib::rpc
