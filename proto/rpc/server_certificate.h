#pragma once
// Whether what answers at an address is a server that may still be trusted.

#include <memory>
#include <string>

namespace grpc::experimental {
class CertificateVerifier;
}  // namespace grpc::experimental

namespace calib::rpc {

/// What a refusal of a revoked certificate says, and no other.
inline constexpr char kRevoked[] = "certificate was revoked";

/// Takes a server that is certified for the host of the address and not revoked by `crl.pem` of the
/// folder, which is read at each handshake; without a list nobody is taken. That the authority of
/// the folder has issued the certificate is gRPC's to check. Thread-safe.
std::shared_ptr<grpc::experimental::CertificateVerifier> MakeServerVerifier(std::string folder);

}  // namespace calib::rpc
