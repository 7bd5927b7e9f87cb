#pragma once
// A peer that keeps to no agreement: any message to any call, streams that are never read or never
// end, connections by the hundred. Everything is bounded in time. No gRPC header is needed to use
// it.

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "calib/v1/worker.pb.h"

namespace calib::testing {

/// One connection. Not thread-safe.
class Attacker {
 public:
  explicit Attacker(const std::string& address);
  ~Attacker();

  /// Sends the message to a method of whatever kind, reads all answers, and returns the status.
  absl::Status Call(const google::protobuf::MethodDescriptor& method,
                    const google::protobuf::Message& message);

  /// Sends a Hello and then the message so often, or until the time is up, and reads nothing; the
  /// number that were taken. Some of them may wait in between.
  int FloodWithoutReading(const v1::Hello& hello, const v1::WorkerMessage& message, int times,
                          std::chrono::milliseconds limit);

  /// Sends so many bytes of a file, or until it is refused, and does not end it before the time is
  /// up. The bytes that were taken.
  std::int64_t UploadWithoutEnd(std::int64_t bytes, std::chrono::milliseconds limit);

  /// Asks for a content so many times at once and reads none of it until the time is up.
  void DownloadWithoutReading(const std::string& digest, int times,
                              std::chrono::milliseconds limit);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Connections that say nothing; closed with it.
class SilentConnections {
 public:
  /// To HOST:PORT with a numeric host of version 4.
  SilentConnections(const std::string& address, int number);
  ~SilentConnections();
  SilentConnections(const SilentConnections&) = delete;
  SilentConnections& operator=(const SilentConnections&) = delete;

 private:
  std::vector<int> files_;
};

}  // namespace calib::testing
