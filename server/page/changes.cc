#include "server/page/changes.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"

namespace calib::page {
namespace {

constexpr std::chrono::seconds kBetweenCalls{1};
constexpr int kReconnectMs = 2000;  // of a browser, after its stream has ended

}  // namespace

/// What one browser has not been told yet: gathered while it reads slowly.
class Changes::EventFeed final : public Feed {
 public:
  explicit EventFeed(Changes& changes) : changes_(changes) { changes_.feeds_.insert(this); }
  ~EventFeed() override { changes_.feeds_.erase(this); }

  void Add(const std::set<Whole>& whole, const std::set<std::string>& campaigns) {
    whole_.insert(whole.begin(), whole.end());
    campaigns_.insert(campaigns.begin(), campaigns.end());
    wake();
  }

  std::string Take() override {
    std::string text;
    if (std::exchange(is_new_, false)) {
      text = absl::StrCat("retry: ", kReconnectMs, "\n");
      Write("hello", {{"server", changes_.instance_}, {"up", changes_.up_}}, text);
    }
    for (const Whole what : std::exchange(whole_, {})) {
      switch (what) {
        case Whole::kServer:
          Write("server", {{"up", changes_.up_}}, text);
          break;
        case Whole::kCampaigns:
          Write("campaigns", nlohmann::json::object(), text);
          break;
        case Whole::kWorkers:
          Write("workers", nlohmann::json::object(), text);
          break;
      }
    }
    for (const std::string& campaign : std::exchange(campaigns_, {})) {
      const Known& known = changes_.campaigns_[campaign];
      Write("campaign",
            {{"campaign", campaign},
             {"version", known.version},
             {"concluded", known.concluded},
             {"states_per_second", known.states_per_second}},
            text);
    }
    return text;
  }

 private:
  void Write(const char* event, const nlohmann::json& data, std::string& text) const {
    absl::StrAppend(&text, "id: ", changes_.instance_, "-", changes_.event_, "\nevent: ", event,
                    "\ndata: ", data.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace),
                    "\n\n");
  }

  Changes& changes_;
  bool is_new_ = true;
  std::set<Whole> whole_;
  std::set<std::string> campaigns_;
};

std::shared_ptr<Feed> Changes::NewFeed() { return std::make_shared<EventFeed>(*this); }

void Changes::Begin() {
  ++epoch_;
  up_ = true;
  any_ = list_ = workers_ = waits_ = 0;
  std::set<std::string> all;  // of them the server knows nothing new, maybe; their numbers are
  for (auto& [campaign, known] : campaigns_) {
    known = {};
    all.insert(campaign);
  }
  Tell({Whole::kServer, Whole::kCampaigns, Whole::kWorkers}, all);
}

void Changes::Lose() {
  if (!std::exchange(up_, false)) return;
  Tell({Whole::kServer}, {});
}

void Changes::Hear(const v1::Changes& changes) {
  std::set<Whole> whole;
  std::set<std::string> campaigns;
  for (const v1::Changes::Campaign& one : changes.campaigns()) {
    campaigns_[one.campaign()] = {.version = one.version(),
                                  .concluded = one.concluded(),
                                  .states_per_second = one.states_per_second()};
    any_ = std::max(any_, one.version());
    campaigns.insert(one.campaign());
  }
  if (std::exchange(waits_, changes.waits()) != changes.waits() ||
      list_ != changes.list()) {  // each status tells of the server too
    whole.insert(Whole::kCampaigns);
  }
  list_ = changes.list();
  if (std::exchange(workers_, changes.workers()) != changes.workers()) {
    whole.insert(Whole::kWorkers);
  }
  Tell(whole, campaigns);
}

void Changes::Tell(const std::set<Whole>& whole, const std::set<std::string>& campaigns) {
  if (whole.empty() && campaigns.empty()) return;
  ++event_;
  for (EventFeed* feed : feeds_) feed->Add(whole, campaigns);
}

std::string Changes::StampOf(const Question& question) const {
  if (!up_) return "";
  const auto found = campaigns_.find(question.campaign);
  const Known known = found == campaigns_.end() ? Known{} : found->second;
  switch (question.document) {
    case Document::kWorkers:  // tells how long ago each was heard
    case Document::kMetrics:
    case Document::kReady:
      return "";
    case Document::kList:
      return absl::StrCat(epoch_, "/", any_, "/", waits_);
    case Document::kLineage:
      return absl::StrCat(epoch_, "/", list_);
    case Document::kShow:  // tells of its children
      return absl::StrCat(epoch_, "/", list_, "/", known.version, "/", waits_);
    case Document::kSamples:
    case Document::kStates:
      return absl::StrCat(epoch_, "/", known.version);
    case Document::kPosterior:
    case Document::kCompare:
    case Document::kDiagnosis:
    case Document::kImprovement:
    case Document::kGrains:
      return absl::StrCat(epoch_, "/", known.concluded);
  }
  return "";
}

ChangesListener::ChangesListener(Connect connect, Changes& changes,
                                 std::function<void(std::function<void()>)> post)
    : connect_(std::move(connect)),
      changes_(changes),
      post_(std::move(post)),
      thread_([this](const std::stop_token& stop) { Run(stop); }) {}

void ChangesListener::Run(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any never;
  while (!stop.stop_requested()) {
    if (auto client = connect_(); client.ok()) Listen(**client, stop);
    post_([this] { changes_.Lose(); });
    std::unique_lock lock(mutex);
    never.wait_for(lock, stop, kBetweenCalls, [] { return false; });
  }
}

void ChangesListener::Listen(client::Client& client, const std::stop_token& stop) {
  bool is_first = true;
  // How it ended is told by its having ended: it is tried again.
  (void)client.WatchChanges(stop, [&](const v1::Changes& changes) {
    post_([this, changes, begins = std::exchange(is_first, false)] {
      if (begins) changes_.Begin();
      changes_.Hear(changes);
    });
  });
}

}  // namespace calib::page
