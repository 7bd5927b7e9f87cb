#include "server/service/core.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>
#include <ctime>
#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "dem/registry/catalog.h"

namespace calib::service {
namespace {

constexpr std::chrono::hours kTidiedAgain{1};
constexpr int kPlanThreads = 2;   // the long computations between iterations
constexpr int kParseThreads = 2;  // campaigns that are parsed, factorised and loaded
constexpr int kTellThreads = 2;   // lists and streams
constexpr int kQueryThreads = 2;  // so that a status is told meanwhile

/// A moment for people, as "2026-01-31 08:05:09 UTC".
std::string InUtc(std::int64_t unix_ms) {
  const std::time_t seconds = unix_ms / 1000;
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  return absl::StrFormat("%04d-%02d-%02d %02d:%02d:%02d UTC", utc.tm_year + 1900, utc.tm_mon + 1,
                         utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec);
}

}  // namespace

struct Core::Threads {
  boost::asio::io_context strand;
  boost::asio::executor_work_guard<boost::asio::io_context::executor_type> keep_running{
      strand.get_executor()};
  boost::asio::steady_timer tick{strand};
  boost::asio::steady_timer pause{strand};
  boost::asio::thread_pool plans{kPlanThreads};
  boost::asio::thread_pool parse{kParseThreads};
  boost::asio::thread_pool tell{kTellThreads};
  boost::asio::thread_pool query{kQueryThreads};
  boost::asio::thread_pool look_after{1};
};

Core::Core(std::unique_ptr<store::Store> store, std::unique_ptr<Guard> guard,
           scheduler::SchedulerOptions options, const Limits& limits,
           std::function<void(const absl::Status&)> on_failure)
    : options_(options),
      on_failure_(std::move(on_failure)),
      guard_(std::move(guard)),
      door_(limits),
      threads_(std::make_unique<Threads>()),
      store_(std::move(store)),
      scheduler_(*this, options),
      tidying_(TidyingSite()),
      thread_([this] { threads_->strand.run(); }) {
  store_->Watch([this](const absl::Status& room) { Post([this, room] { HearOfRoom(room); }); });
}

Core::~Core() {
  BeginShutdown();
  threads_->plans.join();
  threads_->parse.join();
  threads_->tell.join();
  threads_->query.join();
  threads_->look_after.join();
  threads_->keep_running.reset();
  thread_.join();
  // The store then finishes what it was given; nobody waits for those answers any more.
}

absl::Status Core::Start() {
  absl::Status status = scheduler_.Load();
  if (status.ok()) {
    ScheduleTick();
    tidied_ = std::chrono::steady_clock::now();
    tidying_.Begin();
  }
  return status;
}

void Core::BeginShutdown() {
  ends_ = true;
  Post([this] {
    if (health_.ok()) {
      health_ = absl::UnavailableError("the server is going down");
    }
    scheduler_.StopReading();
    for (const auto& [id, session] : sessions_) {
      session->Close(absl::UnavailableError("the server is going down"));
    }
    threads_->tick.cancel();
    threads_->pause.cancel();
    store_->StopWaiting();  // else what it waits to write would keep its calls open
  });
}

boost::asio::io_context& Core::strand() { return threads_->strand; }

void Core::Post(std::function<void()> task) {
  boost::asio::post(threads_->strand,
                    [this, task = std::move(task), asked = std::chrono::steady_clock::now()] {
                      strand_lag_.Add(std::chrono::steady_clock::now() - asked);
                      Turn(task);
                    });
}

void Core::Turn(const std::function<void()>& task) {
  in_turn_ = true;
  task();
  in_turn_ = false;
  if (!asked_.empty()) store_->Write(std::exchange(asked_, {}));
}

void Core::Ask(store::Store::Asked asked) {
  asked_.push_back(std::move(asked));
  if (!in_turn_) store_->Write(std::exchange(asked_, {}));
}

void Core::Query(std::function<void()> task) {
  boost::asio::post(threads_->query, std::move(task));
}

void Core::Tell(std::function<void()> task) { boost::asio::post(threads_->tell, std::move(task)); }

void Core::Parse(std::function<void()> task) {
  boost::asio::post(threads_->parse, std::move(task));
}

void Core::LookAfter(std::function<void()> task) {
  boost::asio::post(threads_->look_after, std::move(task));
}

Tidying::Site Core::TidyingSite() {
  return {.write =
              [this](store::Store::Job job, std::function<void(const absl::Status&)> then) {
                WriteIfRoom(std::move(job), std::move(then));
              },
          .read = [this] { return Read(); },
          .aside =
              [this](std::function<std::function<void()>()> work) {
                LookAfter([this, work = std::move(work)] { Post(work()); });
              },
          .after =
              [this](std::chrono::steady_clock::duration pause, std::function<void()> task) {
                threads_->pause.expires_after(pause);
                threads_->pause.async_wait(
                    [this, task = std::move(task)](const boost::system::error_code& error) {
                      if (!error && health_.ok()) Turn(task);
                    });
              },
          .unix_ms = [this] { return UnixMs(); }};
}

std::int64_t Core::AddSession(Session* session) {
  sessions_[++last_session_] = session;
  return last_session_;
}

void Core::RemoveSession(std::int64_t session) {
  sessions_.erase(session);
  scheduler_.Disconnected(session);
}

void Core::Write(store::Store::Job job, std::function<void(const absl::Status&)> then) {
  Ask({.job = std::move(job), .done = TellsOf(std::move(then))});
}

void Core::WriteIfRoom(store::Store::Job job, std::function<void(const absl::Status&)> then) {
  Ask({.job = std::move(job), .done = TellsOf(std::move(then)), .waits_for_room = false});
}

store::Store::Done Core::TellsOf(std::function<void(const absl::Status&)> then) {
  // Shared, for what it holds, as an answer, would be copied on its way to the strand.
  return [this, asked = std::chrono::steady_clock::now(),
          then = std::make_shared<std::function<void(const absl::Status&)>>(std::move(then))](
             const absl::Status& status) {
    Post([this, status, asked, then] { Written(status, asked, *then); });
  };
}

void Core::Written(absl::Status status, std::chrono::steady_clock::time_point asked,
                   const std::function<void(const absl::Status&)>& then) {
  acknowledgements_.Add(std::chrono::steady_clock::now() - asked);
  if (absl::IsInvalidArgument(status)) {  // its own rows: nothing else is the worse for it
    spdlog::error("write_refused reason=\"{}\"", std::string(status.message()));
  } else if (absl::IsResourceExhausted(status)) {
    spdlog::warn("write_refused reason=\"{}\"", std::string(status.message()));
    status = absl::ResourceExhaustedError(
        absl::StrCat("the disk of the state folder does not take this (", status.message(), "; ",
                     FreeSpace(), "): send it again when that is mended"));
  } else if (absl::IsCancelled(status)) {  // by StopWaiting()
    status = absl::UnavailableError(status.message());
  } else if (!status.ok()) {
    Fail(status);
  }
  then(status);
}

void Core::HearOfRoom(const absl::Status& room) {
  ++changes_of_room_;
  if (!room.ok()) {
    wait_ = Wait{.reason = std::string(room.message()),
                 .began = std::chrono::steady_clock::now(),
                 .began_unix_ms = UnixMs()};
    spdlog::warn("store_waits reason=\"{}\" free=\"{}\"", wait_->reason, FreeSpace());
  } else if (wait_.has_value()) {
    const auto took = std::chrono::steady_clock::now() - wait_->began;
    waited_ += took;
    spdlog::info("store_goes_on waited_s={:.1f} since=\"{}\" reason=\"{}\"",
                 std::chrono::duration<double>(took).count(), InUtc(wait_->began_unix_ms),
                 wait_->reason);
    wait_.reset();
  }
}

std::string Core::FreeSpace() const {
  constexpr double kMebibyte = 1024.0 * 1024.0;
  std::error_code error;
  const auto space = std::filesystem::space(store_->path(), error);
  return error ? "how much is free cannot be told"
               : absl::StrFormat("%.1f MiB are free",
                                 static_cast<double>(space.available) / kMebibyte);
}

std::string Core::WaitsFor() const {
  if (!wait_.has_value()) {
    return "";
  }
  return absl::StrCat("the disk of the state folder takes nothing since ",
                      InUtc(wait_->began_unix_ms), " (", wait_->reason, "; ", FreeSpace(),
                      "); the server goes on by itself when it does");
}

Measured Core::Measure() const {
  Measured measured{
      .engine = dem::EngineVersion(),
      .seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count(),
      .store_waits = wait_.has_value(),
      .campaigns = scheduler_.live(),
      .being_read = scheduler_.being_read(),
      .queued = scheduler_.queued(),
      .planning = scheduler_.planning(),
      .store = store_->Numbers(),
      .acknowledgements = acknowledgements_.Read(),
      .strand_lag = strand_lag_.Read()};
  for (const v1::WorkerInfo& worker : scheduler_.Workers()) {
    if (!worker.connected()) {
      measured.silent += worker.left() ? 0 : 1;
      continue;
    }
    ++measured.workers;
    measured.draining += worker.draining() ? 1 : 0;
    measured.slots += worker.slots();
    measured.busy += worker.busy();
  }
  for (const v1::OwnerShare& share : scheduler_.OwnerShares()) {
    measured.held[share.owner()] = share.held();
  }
  return measured;
}

absl::Status Core::WhyNotStore() const {
  if (health_.ok() && wait_.has_value()) {
    return absl::ResourceExhaustedError(WaitsFor());
  }
  return health_;
}

void Core::Fail(const absl::Status& status) {
  if (std::exchange(failed_, true)) {
    return;
  }
  spdlog::critical("store_failed reason=\"{}\"", std::string(status.message()));
  health_ = status;
  for (const auto& [id, session] : sessions_) {
    session->Close(absl::UnavailableError(status.message()));
  }
  on_failure_(status);
}

void Core::Compute(std::function<std::function<void()>()> work) {
  boost::asio::post(threads_->plans, [this, work = std::move(work)] { Post(work()); });
}

void Core::Load(std::function<std::function<void()>()> work) {
  Parse([this, work = std::move(work)] { Post(work()); });
}

void Core::Send(std::int64_t session, v1::ServerMessage message) {
  if (const auto found = sessions_.find(session); found != sessions_.end()) {
    found->second->Send(std::move(message));
  }
}

void Core::Close(std::int64_t session, const absl::Status& status) {
  if (const auto found = sessions_.find(session); found != sessions_.end()) {
    found->second->Close(status);
  }
}

std::chrono::steady_clock::time_point Core::Now() {
  return (wait_.has_value() ? wait_->began : std::chrono::steady_clock::now()) - waited_;
}

std::int64_t Core::UnixMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

void Core::ScheduleTick() {
  threads_->tick.expires_after(std::clamp<std::chrono::milliseconds>(
      options_.lease / 4, std::chrono::milliseconds(20), std::chrono::milliseconds(1000)));
  threads_->tick.async_wait([this](const boost::system::error_code& error) {
    if (!error && health_.ok()) {
      Turn([this] {
        scheduler_.Tick();
        if (const auto now = std::chrono::steady_clock::now(); now - tidied_ > kTidiedAgain) {
          tidied_ = now;
          tidying_.Begin();
        }
      });
      ScheduleTick();
    }
  });
}

}  // namespace calib::service
