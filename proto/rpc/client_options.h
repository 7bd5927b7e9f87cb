#pragma once
// How every client of this program opens a channel and bounds a call.

#include <chrono>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "proto/rpc/access.h"

namespace grpc {
class Channel;
class ClientContext;
class Server;
}  // namespace grpc

namespace calib::rpc {

/// A question that is answered from the store takes well under a second; this is for a full disk or
/// a machine that swaps.
inline constexpr std::chrono::seconds kUnaryDeadline{30};
/// For calls that carry a file of at most kLargestBlob (chunking.h).
inline constexpr std::chrono::seconds kBlobDeadline{120};

/// A channel with quick reconnects (at most 2 s between tries) and keep-alive pings, so that a peer
/// which vanished without closing its socket is noticed. Never shared with other channels to the
/// same address. With access.tls it shows that certificate, which is read again when it is renewed,
/// and takes only a server of its authority that is certified for the host of the address and not
/// revoked (crl.pem); without, plain text. A token is shown with each call.
std::shared_ptr<grpc::Channel> OpenChannel(const std::string& address, const Access& access);

/// A channel to a server of this very process, with a token that is shown with each call.
std::shared_ptr<grpc::Channel> OpenChannelInside(grpc::Server& server, const std::string& token);

/// Why a channel to the address does not connect, for people. OK: by now something answers there.
/// UNAVAILABLE: nothing listens there. DEADLINE_EXCEEDED: what does says nothing. FAILED_PRECONDITION: something does, and
/// closes the connection, speaks otherwise (plain text, TLS), shows a certificate of another
/// authority or host or one that is revoked. PERMISSION_DENIED: the socket of another account.
/// Takes up to two seconds, at a socket that is open and silent ten.
absl::Status WhyNotConnected(const std::string& address, const Access& access);

/// The call fails with DEADLINE_EXCEEDED this long from now.
void SetDeadline(grpc::ClientContext& context, std::chrono::milliseconds from_now);

}  // namespace calib::rpc
