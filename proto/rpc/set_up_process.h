#pragma once
// What a program settles before it uses gRPC.

namespace calib::rpc {

/// To be called once, first of all, by a program that is or asks a server: gRPC's own log is silent
/// unless $GRPC_VERBOSITY says otherwise (what goes wrong is said in a sentence), and locks are not
/// searched for cycles: Debian's Abseil does that at every lock, of gRPC's too. Not thread-safe.
void SetUpProcess();

}  // namespace calib::rpc
