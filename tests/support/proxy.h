#pragma once
// A link on loopback that can fail.

#include <chrono>
#include <memory>
#include <string>

namespace calib::testing {

/// Hands bytes on between who connects to it and a server, in order, until it is told otherwise.
/// A server that is away refuses through it too. Thread-safe.
class Proxy {
 public:
  /// target: "127.0.0.1:PORT".
  explicit Proxy(const std::string& target);
  ~Proxy();
  Proxy(const Proxy&) = delete;
  Proxy& operator=(const Proxy&) = delete;

  /// "127.0.0.1:PORT", to connect to.
  const std::string& address() const { return address_; }
  /// Ends every connection; what is under way in it is lost.
  void Cut();
  /// What comes in from now on is handed on so much later.
  void SetDelay(std::chrono::milliseconds delay);
  /// While it is silent nothing is handed on and nobody is told; it goes on with what has come in.
  void SetSilent(bool silent);

 private:
  class Switch;
  std::unique_ptr<Switch> switch_;
  std::string address_;
};

}  // namespace calib::testing
