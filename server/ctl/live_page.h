#pragma once
// The live page that calibctl serves itself, beside what it does or for its own sake.

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/client/session.h"
#include "server/page/page.h"

namespace calib::ctl {

/// Not thread-safe.
class LivePage {
 public:
  /// http: HOST:PORT; empty: page::kUsualAddress or, where that is taken, a free port of this
  /// machine. state: folder of the session, whose token the page wants; empty: one is made for it.
  /// Errors: those of Page::Start(); the token cannot be read.
  static absl::StatusOr<LivePage> Serve(const client::Session& session, const std::string& http,
                                        const std::string& state);

  /// With its token.
  std::string url() const { return page_->url(); }
  /// The session may have found its server elsewhere.
  void Follow(const client::Session& session);

 private:
  struct Where;
  LivePage(std::shared_ptr<Where> where, std::unique_ptr<page::Page> page)
      : where_(std::move(where)), page_(std::move(page)) {}
  std::shared_ptr<Where> where_;
  std::unique_ptr<page::Page> page_;
};

}  // namespace calib::ctl
