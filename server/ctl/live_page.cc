#include "server/ctl/live_page.h"

#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/synchronization/mutex.h"
#include "calib/return_if_error.h"
#include "proto/rpc/access.h"
#include "server/access/secret.h"

namespace calib::ctl {

/// Where the server is, for the threads of the page.
struct LivePage::Where {
  absl::Mutex mutex;
  client::Client::Place place ABSL_GUARDED_BY(mutex);

  client::Client::Place Get() {
    absl::MutexLock lock(&mutex);
    return place;
  }
  void Set(client::Client::Place now) {
    absl::MutexLock lock(&mutex);
    place = std::move(now);
  }
};

absl::StatusOr<LivePage> LivePage::Serve(const client::Session& session, const std::string& http,
                                         const std::string& state) {
  auto where = std::make_shared<Where>();
  where->Set(session.place());
  page::PageOptions options{
      .listen = http.empty() ? page::kUsualAddress : http,
      .connect = [where]() -> absl::StatusOr<std::unique_ptr<client::Client>> {
        const client::Client::Place place = where->Get();
        ASSIGN_OR_RETURN(auto client, client::Client::Connect(place.address, place.access));
        // A page says at once that nobody answers, and asks again with the next question.
        client->OnLoss([] { return client::Client::Place{}; });
        return client;
      }};
  if (state.empty()) {
    ASSIGN_OR_RETURN(options.token, access::MakeToken());
  } else {
    ASSIGN_OR_RETURN(options.token, rpc::ReadToken(state + "/token"));
  }
  auto page = page::Page::Start(options);
  if (absl::IsUnavailable(page.status()) && http.empty()) {
    options.listen = "127.0.0.1:0";
    page = page::Page::Start(options);
  }
  RETURN_IF_ERROR(page.status());
  return LivePage(std::move(where), *std::move(page));
}

void LivePage::Follow(const client::Session& session) { where_->Set(session.place()); }

}  // namespace calib::ctl
