#pragma once
// HTTP as its peers write it, byte by byte, over plain sockets of this machine.

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace calib::testing {

struct HttpReply {
  int status = 0;                                ///< 0: the connection ended without a whole head
  std::map<std::string, std::string> headers{};  ///< names in lower case; the last of each
  std::string body{};
};

/// A connection that was made; status 0 and empty texts where it could not be.
class HttpConnection {
 public:
  explicit HttpConnection(int port);
  ~HttpConnection();
  HttpConnection(HttpConnection&& other) noexcept;
  HttpConnection& operator=(HttpConnection&&) = delete;

  bool Send(const std::string& bytes) const;
  /// What comes until the other side closes or `limit` has passed.
  std::string Receive(std::chrono::milliseconds limit);
  /// What comes until it holds `text`; false after `limit`.
  bool ReceiveUntil(const std::string& text, std::chrono::milliseconds limit);
  const std::string& received() const { return received_; }
  /// A reply with a Content-Length, or to HEAD (is_head).
  HttpReply Reply(bool is_head = false, std::chrono::milliseconds limit = std::chrono::seconds(20));
  /// Whether the other side closes within `limit`; what comes before that is received.
  bool IsClosed(std::chrono::milliseconds limit);

 private:
  bool Read(std::chrono::steady_clock::time_point until);

  int socket_ = -1;
  std::string received_;
};

/// One request on a connection of its own. headers: lines without their ends; Host is added where
/// none is among them.
HttpReply Fetch(int port, const std::string& target, const std::vector<std::string>& headers = {},
                const std::string& method = "GET");

}  // namespace calib::testing
