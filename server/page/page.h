#pragma once
// The live page and the documents that it draws, over HTTP. It asks a server as any client does,
// and only reads.

#include <memory>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "server/page/askers.h"
#include "server/page/bundle.h"
#include "server/page/http_server.h"

namespace calib::page {

/// Where calibctl serves the page where nothing else is said.
inline constexpr const char* kUsualAddress = "127.0.0.1:7480";

struct PageOptions {
  std::string listen{};   ///< HOST:PORT, port 0: a free one
  std::string tls{};      ///< folder of the server's certificate; empty: plain text
  bool insecure = false;  ///< plain text may be spoken with other machines
  std::string token{};    ///< of the state folder: who shows it may look
  /// A client of the server that is asked; called on any thread until the page has ended.
  Connect connect{};
  std::span<const BundledFile> files = Bundle();
  HttpLimits limits{};
};

/// Runs threads of its own.
class Page {
 public:
  /// Serves when it returns, whether or not the server can be asked by now. Errors, sentences:
  /// INVALID_ARGUMENT: plain text that other machines reach without `insecure`, a folder of a
  /// certificate that is not in order; UNAVAILABLE: the address is taken, or is none of this
  /// machine.
  static absl::StatusOr<std::unique_ptr<Page>> Start(const PageOptions& options);
  ~Page();
  Page(const Page&) = delete;
  Page& operator=(const Page&) = delete;

  /// http://HOST:PORT/, https where it has a certificate; a host that stands for all addresses as
  /// that of this machine.
  std::string address() const;
  /// The same with ?token=, for people of the account of the state folder.
  std::string url() const { return address() + "?token=" + token(); }
  const std::string& token() const;
  int port() const;

 private:
  struct Impl;
  explicit Page(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace calib::page
