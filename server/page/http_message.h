#pragma once
// Requests and answers of the HTTP server, without its library.

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace calib::page {

struct HttpRequest {
  std::string method{};  ///< "GET", "HEAD"; whatever the peer wrote
  std::string target{};  ///< as it came
  std::string host{};    ///< headers, empty where they are not there
  std::string authorization{};
  std::string cookie{};
  std::string accept_encoding{};
  std::string if_none_match{};
  std::string certificate{};  ///< PEM that the peer showed; empty: none
};

/// An answer without an end: a piece is taken whenever the peer has taken the one before. Lives on
/// the server's thread.
class Feed {
 public:
  virtual ~Feed() = default;
  /// What is to be sent now; empty: nothing.
  virtual std::string Take() = 0;
  /// Called by who fills the feed, once Take() would give something.
  std::function<void()> wake = [] {};
};

struct HttpAnswer {
  int status = 200;
  std::vector<std::pair<std::string, std::string>>
      headers{};                              ///< values without control characters
  std::shared_ptr<const std::string> body{};  ///< null: none
  std::shared_ptr<Feed> feed{};               ///< in the place of a body
};

}  // namespace calib::page
