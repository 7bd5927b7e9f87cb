#include "tests/simulation/simulation.h"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "tests/simulation/faults.h"
#include "tests/simulation/lease_watch.h"
#include "tests/simulation/people.h"

namespace calib::simulation {
namespace {

constexpr const char* kPath = "/nowhere/calib.db";
constexpr milliseconds kLease{1000};
constexpr milliseconds kHeartbeat{100};
/// Once nothing goes wrong any more a campaign is over within these.
constexpr std::chrono::seconds kBound{600};
constexpr int kMostCalmSteps = 400'000;
constexpr std::size_t kLastEvents = 100;

enum class Trouble {
  kCut,
  kWorkerKilled,
  kFrozen,
  kDrained,
  kSignalled,
  kServerKilled,
  kServerStopped,
  kPowerCut,
  kDiskFails,
  kDiskFull,
  kDiskDies,
  kReadFails,
  kUnreadable,
  kTimeJumps,
  kClockJumps,
  kPeople,
  kLooks,
  kLogEmptied
};
constexpr int kTroubles = static_cast<int>(Trouble::kLogEmptied) + 1;

enum class Kind {
  kTask,
  kCommit,
  kPlan,
  kLoad,
  kTell,
  kTick,
  kPause,
  kRead,
  kForget,
  kHear,
  kGo,
  kAsk
};
struct Action {
  Kind kind;
  std::size_t index;
};

/// A message as events have it: of states only which.
std::string Brief(const v1::WorkerMessage& message) {
  std::string text;
  const auto batch = [&text](const v1::StateBatch& of) {
    absl::StrAppend(&text, "states ", of.first(), "-", of.first() + of.states_size() - 1, " of ",
                    of.attempt(), " ");
  };
  if (message.has_states()) batch(message.states());
  for (const v1::StateBatch& gathered : message.gathered().batches()) batch(gathered);
  return text.empty() ? message.ShortDebugString() : text;
}

/// What a campaign comes to where nothing goes wrong, by number.
const std::string& Undisturbed(int campaign) {
  static std::map<int, std::string> known;
  const auto found = known.find(campaign);
  if (found != known.end()) return found->second;
  const SimulationResult calm = Simulate({.seed = 1, .campaign = campaign});
  return known[campaign] =
             calm.violation.empty() ? calm.fingerprint : "undisturbed: " + calm.violation;
}

class Simulation final : public Watcher, public Surroundings {
 public:
  explicit Simulation(const SimulationOptions& options)
      : options_(options), dice_(options.seed), calm_(options.campaign >= 0), ledger_(disk_) {
    disk_.Format(dice_.Next());
    disk_.forgets_to_sync = options.fault == "no_sync";
    disk_.unix_ms = clocks_.unix_ms;
    clocks_.now += std::chrono::hours(1);
    began_ = clocks_.now;
    calm_at_ = clocks_.now;
  }

  SimulationResult Run() {
    Cast();
    StartServer();
    while (result_.violation.empty() && !IsOver()) Step();
    if (result_.violation.empty()) Settle();
    StopServer(/*in_order=*/false, /*power=*/false);
    for (WorkerProcess& worker : workers_) worker.Kill();
    result_.calm_seconds = std::chrono::duration<double>(clocks_.now - calm_at_).count();
    result_.seconds = std::chrono::duration<double>(clocks_.now - began_).count();
    result_.last.assign(last_.begin(), last_.end());
    return std::move(result_);
  }

  // ---- Watcher ----
  void Takes(const Stream& stream, const v1::WorkerMessage& message) override {
    Tell("takes", stream, Brief(message));
    ledger_.Takes(message);
    if (message.has_hello()) return;
    leases_.Heard(workers_[Worker(stream)].options().name, stream.number, false, clocks_.now);
  }
  void Sends(const Stream& stream, const v1::ServerMessage& message) override {
    Tell("sends", stream,
         message.has_lease() ? absl::StrCat("lease ", message.lease().attempt(), " of ",
                                            message.lease().run().substr(0, 8))
                             : message.ShortDebugString());
    if (message.has_welcome())
      leases_.Heard(workers_[Worker(stream)].options().name, stream.number, true, clocks_.now);
    Violate(ledger_.Sends(
        stream.name.empty() ? workers_[Worker(stream)].options().name : stream.name, message));
  }
  void Wrote(const absl::Status& status) override {
    if (status.ok()) return;
    Event(absl::StrCat("a write came to ", status.ToString()));
    if (absl::IsInvalidArgument(status)) {
      Violate(absl::StrCat("the store refuses a row: ", std::string(status.message())));
    }
  }
  void AfterTask(bool of_tick) override {
    Violate(leases_.Look(server_->scheduler(), clocks_.now, of_tick));
  }
  milliseconds Delay() override {
    if (calm_) return milliseconds(dice_.Below(3));
    if (slow_wire_ && dice_.OnceIn(300)) return milliseconds(dice_.Between(100, 2500));
    return milliseconds(dice_.OnceIn(20) ? dice_.Below(120) : dice_.Below(4));
  }

  // ---- Surroundings ----
  std::shared_ptr<Stream> Open(int worker) override {
    auto stream = std::make_shared<Stream>();
    stream->number = ++last_stream_;
    stream->worker = worker;
    stream->cut = server_ == nullptr;
    stream->server_left = stream->cut;
    streams_.push_back(stream);
    if (server_ != nullptr) server_->Accept(stream);
    return stream;
  }
  milliseconds Pace() override {
    if (!calm_ && slow_runs_ && dice_.OnceIn(60)) return milliseconds(dice_.Between(500, 2500));
    return milliseconds(dice_.Between(1, 40));
  }
  bool NodeFails() override { return !calm_ && nodes_fail_ && dice_.OnceIn(150); }
  bool IsHasty() override { return !calm_ && nodes_fail_ && dice_.OnceIn(150); }
  void Reached(std::int64_t attempt, int states) override { ledger_.Reached(attempt, states); }

 private:
  // ---- who takes part ----
  void Cast() {
    const bool alone = options_.campaign >= 0;
    const int workers = alone ? 1 : dice_.Between(1, 3);
    const bool share = dice_.OnceIn(3);
    const auto shared = std::make_shared<std::map<std::string, int>>();
    for (int i = 0; i < workers; ++i) {
      workers_.emplace_back(
          clocks_, static_cast<Surroundings&>(*this),
          WorkerProcess::Options{
              .number = i,
              .name = absl::StrCat("w", i),
              .slots = SlotsOf(i),
              .folder_name = share ? "folder of all" : absl::StrCat("folder of w", i),
              .folder = share ? shared : std::make_shared<std::map<std::string, int>>()});
      starts_.push_back(clocks_.now);
      gone_.push_back(false);
    }
    people_.Submit(alone ? options_.campaign : AnyCampaign(), "ann", clocks_.now);
    if (alone) return;
    calm_at_ = clocks_.now + milliseconds(dice_.Between(500, 15000));
    for (int i = 0; i < kTroubles; ++i) {
      if (dice_.OnceIn(2)) troubles_.push_back(static_cast<Trouble>(i));
    }
    trouble_every_ = dice_.OnceIn(3) ? dice_.Between(40, 120) : dice_.Between(100, 900);
    slow_wire_ = dice_.OnceIn(2);
    slow_runs_ = dice_.OnceIn(3);
    nodes_fail_ = dice_.OnceIn(3);
    gathers_ = !dice_.OnceIn(3);
    if (dice_.OnceIn(3)) {
      const int campaign = dice_.OnceIn(3) ? people_.first_campaign() : AnyCampaign();
      people_.Submit(campaign, "bob", clocks_.now + milliseconds(dice_.Below(3000)));
    }
  }

  /// The first can run what needs two.
  int SlotsOf(int worker) {
    return options_.campaign >= 0 ? 2 : dice_.Between(worker == 0 ? 2 : 1, 3);
  }

  int AnyCampaign() {
    int all = 0;
    for (const SimulatedCampaign& campaign : Campaigns()) all += campaign.often;
    int chosen = dice_.Below(all);
    int i = 0;
    while ((chosen -= Campaigns()[static_cast<std::size_t>(i)].often) >= 0) ++i;
    return i;
  }

  // ---- what goes on ----
  void Step() {
    if (!calm_ && clocks_.now >= calm_at_) BeCalm();
    if (!calm_ && dice_.OnceIn(trouble_every_)) Meet(AnyTrouble());
    if (server_ == nullptr && clocks_.now >= server_starts_) StartServer();
    for (std::size_t i = 0; i < workers_.size(); ++i) {
      if (workers_[i].runs() || gone_[i]) continue;
      if (starts_[i] == Time::max()) {
        starts_[i] = clocks_.now + milliseconds(calm_ ? 10 : dice_.Between(10, 2000));
      } else if (clocks_.now >= starts_[i]) {
        starts_[i] = Time::max();
        Event(absl::StrCat("worker ", i, " starts"));
        if (!calm_ && dice_.OnceIn(4)) workers_[i].SetSlots(SlotsOf(static_cast<int>(i)));
        workers_[i].Start();
      }
    }
    Collect();
    if (actions_.empty()) {
      AdvanceTo(NextDue());
    } else if (dice_.OnceIn(8)) {
      AdvanceTo(clocks_.now + milliseconds(dice_.Below(5)));
    } else {
      Do(actions_[static_cast<std::size_t>(dice_.Below(static_cast<int>(actions_.size())))]);
    }
    if (server_ != nullptr && (disk_.left() || (server_->failed() && dice_.OnceIn(10)))) {
      const bool in_order = !disk_.left() && dice_.OnceIn(2);
      StopServer(in_order, /*power=*/dice_.OnceIn(2));
    }
    std::erase_if(streams_, [](const auto& s) { return s->worker_left && s->server_left; });
    if (calm_ && (++calm_steps_ > kMostCalmSteps || clocks_.now > calm_at_ + kBound)) {
      std::string open;
      for (const std::int64_t id : ledger_.Open()) {
        absl::StrAppend(&open, "; ", ledger_.Summary(id));
      }
      for (const std::string& verb : people_.Waiting()) {
        absl::StrAppend(&open, "; no answer to ", verb);
      }
      for (const WorkerProcess& worker : workers_) {
        absl::StrAppend(&open, "; ", worker.options().name, " holds ", worker.holds());
      }
      Violate(absl::StrCat("it goes on for ever", open));
    }
  }

  void Collect() {
    actions_.clear();
    const auto add = [this](Kind kind, std::size_t count) {
      for (std::size_t i = 0; i < count; ++i) actions_.push_back({kind, i});
    };
    if (server_ != nullptr) {
      // The strand is as fast as all else together.
      add(Kind::kTask, std::min<std::size_t>(server_->tasks(), 3));
      add(Kind::kCommit, std::min<std::size_t>(server_->writes(), 2));
      add(Kind::kPlan, server_->plans());
      add(Kind::kLoad, server_->loads());
      add(Kind::kTell, server_->results());
      if (server_->ticks()) add(Kind::kTick, 1);
      if (server_->pauses_end()) add(Kind::kPause, 1);
      for (std::size_t i = 0; i < streams_.size(); ++i) {
        if (server_->MayRead(*streams_[i])) actions_.push_back({Kind::kRead, i});
        if (server_->MayForget(*streams_[i])) actions_.push_back({Kind::kForget, i});
      }
      for (std::size_t i = 0; i < people_.wishes(); ++i) {
        if (people_.IsDue(i)) actions_.push_back({Kind::kAsk, i});
      }
    }
    for (std::size_t i = 0; i < workers_.size(); ++i) {
      const WorkerProcess& worker = workers_[i];
      if (!worker.runs() || clocks_.now < worker.frozen_until) continue;
      if (worker.next() <= clocks_.now) actions_.push_back({Kind::kGo, i});
      const auto& stream = worker.stream();
      if (stream == nullptr || stream->worker_left) continue;
      if (stream->down.empty() ? stream->cut || stream->server_left
                               : stream->down.front().due <= clocks_.now) {
        actions_.push_back({Kind::kHear, i});
      }
    }
  }

  void Do(const Action& action) {
    const std::size_t i = action.index;
    switch (action.kind) {
      case Kind::kTask:
        server_->RunTask();
        break;
      case Kind::kCommit: {
        const auto most = static_cast<std::size_t>(dice_.Between(1, 6));
        Event(absl::StrCat("commit of ", std::min(most, server_->writes())));
        server_->Commit(most);
        break;
      }
      case Kind::kPlan:
        Event("plan");
        server_->Plan(i);
        break;
      case Kind::kLoad:
        Event("load");
        server_->Load(i);
        break;
      case Kind::kTell:
        server_->Tell(i);
        break;
      case Kind::kTick:
        server_->PostTick();
        break;
      case Kind::kPause:
        server_->EndPause();
        break;
      case Kind::kRead:
        server_->ReadFrom(streams_[i]);
        break;
      case Kind::kForget:
        Event(absl::StrCat("stream ", streams_[i]->number, " is forgotten"));
        server_->Forget(streams_[i]);
        break;
      case Kind::kHear:
        Hear(workers_[i]);
        break;
      case Kind::kGo:
        workers_[i].Go();
        break;
      case Kind::kAsk:
        people_.Ask(i, *server_);
        break;
    }
  }

  void Hear(WorkerProcess& worker) {
    const std::shared_ptr<Stream> stream = worker.stream();
    if (stream->down.empty()) {
      Event(absl::StrCat("stream ", stream->number, " ends for ", worker.options().name));
      worker.Closed(stream->cut ? absl::UnavailableError("cut")
                                : stream->ended.value_or(absl::OkStatus()));
      return;
    }
    const v1::ServerMessage message = std::move(stream->down.front().message);
    stream->down.pop_front();
    worker.Receive(message);
  }

  Time NextDue() const {
    Time next = Time::max();
    const auto at = [&next](Time time) { next = std::min(next, time); };
    for (std::size_t i = 0; i < workers_.size(); ++i) {
      if (!gone_[i]) at(workers_[i].runs() ? workers_[i].next() : starts_[i]);
      const auto& stream = workers_[i].stream();
      if (stream == nullptr || stream->worker_left) continue;
      if (!stream->down.empty()) at(std::max(stream->down.front().due, workers_[i].frozen_until));
      if (stream->cut) at(workers_[i].frozen_until);
    }
    if (server_ == nullptr) {
      at(server_starts_);
    } else {
      at(server_->next_tick());
      for (const auto& stream : streams_) {
        if (!stream->up.empty() && !stream->server_left) at(stream->up.front().due);
      }
      at(people_.next());
    }
    if (!calm_) at(calm_at_);
    return std::max(next, clocks_.now + milliseconds(1));
  }

  void AdvanceTo(Time time) {
    if (time == Time::max()) time = clocks_.now + kLease;
    clocks_.unix_ms += std::chrono::duration_cast<milliseconds>(time - clocks_.now).count();
    clocks_.now = time;
    disk_.unix_ms = clocks_.unix_ms;
  }

  // ---- the server comes and goes ----
  void StartServer() {
    disk_.Mount();
    // A file of an earlier schema is copied before it is migrated, and not on this disk.
    if (!calm_ && has_started_ && dice_.OnceIn(8)) {
      const DiskTrouble trouble = dice_.OnceIn(2) ? DiskTrouble::kDies : DiskTrouble::kReadFails;
      disk_.Expect(trouble, dice_.Below(40), 1);
    }
    server_ = std::make_unique<ServerProcess>(
        clocks_, dice_, static_cast<Watcher&>(*this),
        PortFaults{.acknowledges_early = options_.fault == "early_acknowledgement",
                   .reorders_writes = options_.fault == "reordered_writes"});
    leases_ = LeaseWatch(kLease);
    const absl::Status started = server_->Start(kPath, {.lease = kLease,
                                                        .heartbeat = kHeartbeat,
                                                        .gather = milliseconds(gathers_ ? 30 : 0),
                                                        .most_campaigns = 12});
    if (started.ok() && !disk_.left()) {
      Event("the server starts");
      has_started_ = true;
      ledger_.Open(kPath);
      Violate(ledger_.Check());
      return;
    }
    Event(absl::StrCat("the server does not start: ", started.ToString()));
    const bool may_be =
        absl::IsPermissionDenied(started) || absl::IsResourceExhausted(started) || disk_.left();
    if (calm_ || !may_be) Violate(absl::StrCat("the server does not start: ", started.ToString()));
    StopServer(/*in_order=*/false, dice_.OnceIn(2));
  }

  void StopServer(bool in_order, bool power) {
    if (server_ == nullptr) return;
    Event(
        absl::StrCat("the server ", in_order ? "stops" : "is killed", power ? ", power cut" : ""));
    ++result_.restarts;
    if (in_order) server_->WriteAll();
    for (const auto& stream : streams_) {
      if (stream->server_left) continue;
      stream->server_left = true;
      Cut(*stream);
      stream->up.clear();
    }
    if (!in_order) disk_.LeaveProgram();
    ledger_.Close();
    server_.reset();
    if (!in_order && power) disk_.CutPower(dice_);
    people_.ServerIsGone();
    server_starts_ = clocks_.now + milliseconds(calm_ ? 20 : dice_.Between(20, 2500));
  }

  /// What is on its way is lost from some message on, both ways.
  void Cut(Stream& stream) {
    if (std::exchange(stream.cut, true)) return;
    stream.up.resize(
        static_cast<std::size_t>(dice_.Between(0, static_cast<int>(stream.up.size()))));
    stream.down.resize(
        static_cast<std::size_t>(dice_.Between(0, static_cast<int>(stream.down.size()))));
  }

  // ---- troubles ----
  Trouble AnyTrouble() {
    return troubles_.empty() ? Trouble::kLooks
                             : troubles_[static_cast<std::size_t>(
                                   dice_.Below(static_cast<int>(troubles_.size())))];
  }

  void Meet(Trouble trouble) {
    const auto i = static_cast<std::size_t>(dice_.Below(static_cast<int>(workers_.size())));
    WorkerProcess& worker = workers_[i];
    const auto soon = [this](int most) { return dice_.Below(most); };
    switch (trouble) {
      case Trouble::kCut:
        if (worker.stream() != nullptr) {
          Event(absl::StrCat("cut of stream ", worker.stream()->number));
          Cut(*worker.stream());
        }
        break;
      case Trouble::kWorkerKilled:
        Event(absl::StrCat("worker ", i, " is killed"));
        if (worker.stream() != nullptr) Cut(*worker.stream());
        worker.Kill();
        if (dice_.OnceIn(2)) worker.LoseFolder();
        gone_[i] = i > 0 && dice_.OnceIn(5);  // for good
        break;
      case Trouble::kFrozen: {
        const int ms = dice_.Between(100, 4000);
        Event(absl::StrCat("worker ", i, " freezes for ", ms, " ms"));
        worker.frozen_until = clocks_.now + milliseconds(ms);
        break;
      }
      case Trouble::kDrained:
        if (server_ != nullptr && !server_->failed()) {
          const int within = dice_.OnceIn(2) ? 0 : dice_.Between(1, 500);
          Event(absl::StrCat("worker ", i, " is to drain within ", within, " ms"));
          (void)server_->scheduler().Drain(worker.options().name, milliseconds(within));
          AfterTask(/*of_tick=*/false);
        }
        break;
      case Trouble::kSignalled:
        if (worker.runs() && clocks_.now >= worker.frozen_until) {
          Event(absl::StrCat("worker ", i, " is told to leave"));
          worker.Signal(dice_.OnceIn(2) ? std::optional(milliseconds(dice_.Between(1, 300)))
                                        : std::nullopt);
        }
        break;
      case Trouble::kServerKilled:
        StopServer(false, false);
        break;
      case Trouble::kServerStopped:
        StopServer(true, false);
        break;
      case Trouble::kPowerCut:
        StopServer(false, true);
        break;
      case Trouble::kDiskFails:
        disk_.Expect(DiskTrouble::kWriteFails, soon(40), 1);
        break;
      case Trouble::kDiskFull: {
        const int times = dice_.Between(1, 5);
        disk_.Expect(DiskTrouble::kFull, soon(40), times);
        break;
      }
      case Trouble::kDiskDies:
        disk_.Expect(DiskTrouble::kDies, soon(60), 1);
        break;
      case Trouble::kReadFails:
        disk_.Expect(DiskTrouble::kReadFails, soon(60), 1);
        break;
      case Trouble::kUnreadable:
        if (server_ != nullptr) server_->unreadable = dice_.Between(1, 3);
        break;
      case Trouble::kTimeJumps: {
        const int ms = dice_.Between(300, 6000);
        Event(absl::StrCat(ms, " ms go by at once"));
        AdvanceTo(clocks_.now + milliseconds(ms));
        break;
      }
      case Trouble::kClockJumps:
        clocks_.unix_ms += dice_.Between(-3'600'000, 3'600'000);
        break;
      case Trouble::kPeople:
        people_.WishAnything();
        break;
      case Trouble::kLooks:
        if (server_ != nullptr && !server_->failed()) (void)server_->scheduler().AllLive();
        break;
      case Trouble::kLogEmptied:
        if (server_ != nullptr) ledger_.EmptyLog();
        break;
    }
  }

  void BeCalm() {
    Event("calm");
    calm_ = true;
    calm_at_ = clocks_.now;
    slow_wire_ = false;
    disk_.ExpectNothing();
    for (WorkerProcess& worker : workers_) {
      worker.frozen_until = std::min(worker.frozen_until, clocks_.now);
    }
    if (server_ != nullptr) server_->unreadable = 0;
  }

  // ---- the end ----
  bool IsOver() {
    if (++looked_ % 16 != 0 || server_ == nullptr) return false;
    if (clocks_.now >= set_right_at_) {
      set_right_at_ = clocks_.now + milliseconds(calm_ ? 300 : 2500);
      if (calm_ || dice_.OnceIn(2)) people_.SetRight();
    }
    if (!people_.Waiting().empty()) return false;
    if (!ledger_.Open().empty()) return false;
    if (!calm_) BeCalm();
    return std::all_of(workers_.begin(), workers_.end(),
                       [](const WorkerProcess& worker) { return worker.holds() == 0; });
  }

  void Settle() {
    Event("all campaigns are over");
    disk_.ExpectNothing();
    calm_ = true;
    StopServer(/*in_order=*/dice_.OnceIn(3), /*power=*/true);
    StartServer();
    if (!result_.violation.empty()) return;
    auto reader = server_->Read();
    for (const auto& [id, campaign] : people_.submitted()) {
      const std::string state = ledger_.StateOf(id);
      if (state == "cancelled" || state.empty()) continue;
      if (state != "finished") {
        Violate(absl::StrCat("c", id, " has ", state, ", not finished"));
        continue;
      }
      const SimulatedCampaign& of = Campaigns()[static_cast<std::size_t>(campaign)];
      Violate(ledger_.CheckEnd(
          {.campaign = id, .resumed = people_.HasResumed(id), .goes_on = of.goes_on}));
      auto fingerprint = Fingerprint(*reader, id);
      if (!fingerprint.ok()) {
        Violate(absl::StrCat("c", id, " cannot be read: ", fingerprint.status().ToString()));
      } else if (options_.campaign >= 0) {
        result_.fingerprint = *std::move(fingerprint);
      } else if (of.same_bits) {
        found_.emplace_back(campaign, *std::move(fingerprint));
      }
    }
  }

  void Violate(const std::string& what) {
    if (what.empty() || !result_.violation.empty()) return;
    Event("VIOLATION " + what);
    result_.violation = what;
  }

  void Tell(const char* what, const Stream& stream, const std::string& text) {
    Event(absl::StrCat("stream ", stream.number, " of w", stream.worker, " ", what, " ", text));
  }

  void Event(const std::string& what) {
    const double seconds = std::chrono::duration<double>(clocks_.now - began_).count();
    std::string line = absl::StrFormat("%8.3f %s", seconds, what);
    if (options_.traces_all) std::printf("%s\n", line.c_str());
    for (const char c : line) {  // FNV-1a
      result_.digest = (result_.digest ^ static_cast<unsigned char>(c)) * 0x100000001B3U;
    }
    ++result_.events;
    if (last_.size() == kLastEvents) last_.pop_front();
    last_.push_back(std::move(line));
  }

  static std::size_t Worker(const Stream& stream) {
    return static_cast<std::size_t>(stream.worker);
  }

 public:
  /// What campaigns have come to, by number; to be compared once this is gone.
  std::vector<std::pair<int, std::string>> found_;

 private:
  const SimulationOptions options_;
  SimulationResult result_{.digest = 0xCBF29CE484222325U};
  Clocks clocks_;
  Time began_{};
  Dice dice_;
  bool calm_;
  Time calm_at_{};
  int calm_steps_ = 0;
  CrashFileSystem disk_;
  Ledger ledger_;
  std::unique_ptr<ServerProcess> server_;
  Time server_starts_{};
  bool has_started_ = false;
  std::deque<WorkerProcess> workers_;
  std::vector<Time> starts_;
  std::vector<bool> gone_;
  std::vector<std::shared_ptr<Stream>> streams_;
  int last_stream_ = 0;
  People people_{clocks_,
                 dice_,
                 ledger_,
                 {.event = [this](const std::string& what) { Event(what); },
                  .violate = [this](const std::string& what) { Violate(what); }}};
  Time set_right_at_{};
  std::vector<Trouble> troubles_;
  int trouble_every_ = 100;
  bool slow_wire_ = false;
  bool slow_runs_ = false;
  bool nodes_fail_ = false;
  bool gathers_ = true;
  std::vector<Action> actions_;
  LeaseWatch leases_{kLease};
  unsigned looked_ = 0;
  std::deque<std::string> last_;
};

}  // namespace

SimulationResult Simulate(const SimulationOptions& options) {
  SimulationResult result;
  std::vector<std::pair<int, std::string>> found;
  planted = options.fault;
  granted.clear();
  counted.clear();
  {
    auto simulation = std::make_unique<Simulation>(options);
    result = simulation->Run();
    found = std::move(simulation->found_);
  }
  planted.clear();
  for (const auto& [campaign, fingerprint] : found) {
    const std::string& undisturbed = Undisturbed(campaign);
    if (!result.violation.empty() || fingerprint == undisturbed) continue;
    const std::size_t at =
        static_cast<std::size_t>(std::mismatch(fingerprint.begin(), fingerprint.end(),
                                               undisturbed.begin(), undisturbed.end())
                                     .first -
                                 fingerprint.begin());
    const auto near = [at](const std::string& text) {
      const std::size_t from = at < 60 ? 0 : at - 60;
      return from >= text.size() ? "" : absl::CHexEscape(text.substr(from, 120));
    };
    result.violation =
        absl::StrCat("campaign ", Campaigns()[static_cast<std::size_t>(campaign)].name,
                     " has other bits than undisturbed, from byte ", at, ": ", near(fingerprint),
                     " and ", near(undisturbed));
  }
  return result;
}

}  // namespace calib::simulation
