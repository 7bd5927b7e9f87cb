#include "worker/worker.h"

#include <spdlog/spdlog.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <csignal>
#include <map>
#include <thread>
#include <utility>

#include "dem/registry/catalog.h"
#include "proto/calib/v1/protocol.h"
#include "proto/rpc/backoff.h"
#include "proto/rpc/check_message.h"
#include "proto/rpc/client_options.h"
#include "proto/rpc/digest.h"
#include "proto/rpc/random_id.h"
#include "proto/rpc/text_kinds.h"
#include "worker/engine/checkpoints.h"
#include "worker/engine/engines.h"
#include "worker/held_attempt.h"
#include "worker/program/programs.h"
#include "worker/server_link.h"

namespace calib::worker {
namespace {

namespace asio = boost::asio;

constexpr char kLeaving[] = "the worker is leaving";

/// A state has some ten numbers: far below the limit of a message.
constexpr int kStatesPerMessage = 1000;

/// After these the server would say the same again.
bool IsFinal(const absl::Status& status) {
  return absl::IsPermissionDenied(status) ||
         status.code() == absl::StatusCode::kFailedPrecondition ||
         status.code() == absl::StatusCode::kAlreadyExists ||
         status.code() == absl::StatusCode::kInvalidArgument;
}

}  // namespace

/// Everything happens on the thread that runs io_; other threads post to it.
class Worker::Impl {
 public:
  explicit Impl(WorkerOptions options)
      : options_(std::move(options)),
        signals_(io_, SIGTERM, SIGINT),
        heartbeat_(io_),
        reconnect_(io_),
        farewell_(io_),
        gather_(io_),
        link_(options_.server, options_.access,
              {.received =
                   [this](v1::ServerMessage message) {
                     asio::post(io_, [this, message = std::move(message)] { Receive(message); });
                   },
               .closed =
                   [this](const absl::Status& status) {
                     asio::post(io_, [this, status] { Closed(status); });
                   }}),
        engines_({.program = options_.engine,
                  .fetch =
                      [this](const std::string& digest, std::stop_token stop) {
                        return link_.GetBlob(digest, std::move(stop));
                      },
                  .scratch = options_.scratch,
                  .checkpoints = options_.checkpoints,
                  .most_checkpoint_bytes = options_.most_checkpoint_bytes}),
        programs_({.fetch =
                       [this](const std::string& digest, std::stop_token stop) {
                         return link_.GetBlob(digest, std::move(stop));
                       },
                   .put =
                       [this](const std::string& content, std::stop_token stop) {
                         return link_.PutBlob(content, std::move(stop));
                       },
                   .scratch = options_.scratch,
                   .allowed = options_.allowed_commands,
                   .slots = options_.slots}) {}

  absl::Status Run() {
    WaitForSignal();
    for (const std::string& name : programs_.NotFound()) {
      spdlog::warn("not_found allow_command={}: no campaign can run it here", name);
    }
    if (!options_.checkpoints.empty()) {
      const auto opened = Checkpoints::Open(options_.checkpoints, options_.most_checkpoint_bytes);
      if (opened.ok()) {
        checkpoints_ = opened->identity();
      } else {
        spdlog::warn("no_checkpoints reason=\"{}\"", std::string(opened.status().message()));
      }
    }
    Connect();
    io_.run();
    return result_;
  }

 private:
  // ---- the link ----

  void Connect() {
    v1::Hello hello;
    hello.set_name(options_.name);
    hello.set_instance(instance_);
    hello.set_slots(options_.slots);
    hello.set_threads_per_slot(options_.threads_per_slot);
    hello.set_contact_updates_per_second(options_.contact_updates_per_second);
    hello.set_threads(options_.threads);
    hello.set_memory(options_.memory);
    hello.set_user(rpc::Fitted(v1::NAME, options_.user));
    hello.set_engine_version(dem::EngineVersion());
    hello.set_catalog_digest(rpc::Sha256Hex(dem::CatalogText()));
    hello.set_cpu(rpc::Fitted(v1::NAME, options_.cpu));
    for (const std::string& name : programs_.AllowedNames()) hello.add_programs(name);
    hello.set_checkpoints(checkpoints_);
    hello.set_protocol(kProtocol);
    hello.add_features(kLimitsRuns);
    for (auto& [id, attempt] : held_) {
      hello.add_attempts(id);
      attempt.StreamLost();
    }
    open_ = true;
    if (const absl::Status status = link_.Open(hello); !status.ok()) {
      Closed(status);
    }
  }

  void Closed(const absl::Status& status) {
    open_ = false;
    const bool was_welcome = std::exchange(welcome_, false);
    heartbeat_.cancel();
    if (stopping_ || leaving_) {
      Quit();
      return;
    }
    // A worker that was welcome may have been given a new certificate since.
    if (IsFinal(status) ||
        (absl::IsUnauthenticated(status) && !was_welcome && !link_.HasMoreToShow())) {
      spdlog::error("refused server={} reason=\"{}\"", options_.server,
                    std::string(status.message()));
      result_ = status;
      stopping_ = true;
      Quit();
      return;
    }
    const auto wait = backoff_.Next();
    spdlog::warn("disconnected server={} reason=\"{}\" retry_ms={}", options_.server,
                 std::string(status.message()), wait.count());
    if (absl::IsUnavailable(status)) {
      LookWhy();
    }
    reconnect_.expires_after(wait);
    reconnect_.async_wait([this](const boost::system::error_code& error) {
      if (!error && !stopping_) {
        Connect();
      }
    });
  }

  /// Says in the log, once an outage, what is wrong with a server that is there and cannot be
  /// talked to: that it speaks otherwise, or is not to be trusted. One that is only away may be
  /// such when it comes.
  void LookWhy() {
    if (said_why_ || std::exchange(looks_why_, true)) {
      return;
    }
    looking_why_ = std::jthread([this] {
      const auto access = rpc::FindAccess(options_.server, options_.access);
      const absl::Status why =
          access.ok() ? rpc::WhyNotConnected(options_.server, *access) : access.status();
      asio::post(io_, [this, why] {
        looks_why_ = false;
        if (welcome_ || stopping_ || why.ok() || absl::IsUnavailable(why)) {
          return;
        }
        said_why_ = true;
        spdlog::error("no_connection server={} reason=\"{}\"", options_.server,
                      std::string(why.message()));
      });
    });
  }

  void Receive(const v1::ServerMessage& message) {
    if (const absl::Status broken = rpc::CheckMessage(message); !broken.ok()) {
      Refuse(message, broken);
      return;
    }
    switch (message.message_case()) {
      case v1::ServerMessage::kWelcome:
        Welcome(message.welcome());
        break;
      case v1::ServerMessage::kLease:
        Take(message.lease());
        break;
      case v1::ServerMessage::kAck:
        Acknowledged(message.ack());
        break;
      case v1::ServerMessage::kAcks:
        for (const v1::Ack& ack : message.acks().acks()) {
          Acknowledged(ack);
        }
        break;
      case v1::ServerMessage::kStop:
        spdlog::info("stop attempt={}", message.stop().attempt());
        Drop(message.stop().attempt());
        break;
      case v1::ServerMessage::kDrain:
        if (message.drain().within_ms() > 0) {
          DrainWithin(std::chrono::milliseconds(message.drain().within_ms()));
        } else {
          spdlog::info("draining running={}", held_.size());
          draining_ = true;
          LeaveIfDrained();
        }
        break;
      case v1::ServerMessage::MESSAGE_NOT_SET:
        break;
    }
  }

  /// What breaks a rule is not done. A lease that does has failed, so that it is told why; the rest
  /// is said in the log, once.
  void Refuse(const v1::ServerMessage& message, const absl::Status& broken) {
    if (!std::exchange(said_refusal_, true)) {
      spdlog::error("message_refused reason=\"{}\"", std::string(broken.message()));
    }
    const std::int64_t id = message.lease().attempt();
    if (id < 1) {
      return;
    }
    auto [it, added] = held_.try_emplace(id, message.lease());
    if (added) {
      EndWithout(it->second, id, v1::Finished::OUTCOME_FAILED, std::string(broken.message()));
    }
  }

  /// The end of an attempt that was never begun.
  void EndWithout(HeldAttempt& attempt, std::int64_t id, v1::Finished::Outcome outcome,
                  const std::string& reason) {
    v1::Finished finished;
    finished.set_attempt(id);
    finished.set_outcome(outcome);
    finished.set_reason(reason);
    attempt.AddEnd(std::move(finished));
    Send(attempt);
  }

  void Welcome(const v1::Welcome& welcome) {
    if (const absl::Status status = CheckProtocol("the server", welcome.protocol(), "this worker");
        !status.ok()) {
      link_.FinishSending();
      Closed(status);
      return;
    }
    spdlog::info("connected server={} held={}", options_.server, held_.size());
    if (!welcome.waits().empty()) spdlog::warn("waits reason=\"{}\"", welcome.waits());
    welcome_ = true;
    said_why_ = false;
    backoff_.Reset();
    heartbeat_every_ = std::chrono::milliseconds(std::max(1, welcome.heartbeat_ms()));
    gather_for_ = std::chrono::milliseconds(welcome.gather_ms());
    for (auto& [id, attempt] : held_) {
      Send(attempt);
    }
    Beat();
  }

  void Beat() {
    v1::WorkerMessage message;
    message.mutable_heartbeat();
    for (const auto& [id, attempt] : held_) {
      message.mutable_heartbeat()->add_attempts(id);
    }
    link_.Send(std::move(message));
    heartbeat_.expires_after(heartbeat_every_);
    heartbeat_.async_wait([this](const boost::system::error_code& error) {
      if (!error && welcome_) {
        Beat();
      }
    });
  }

  void Send(HeldAttempt& attempt) {
    if (welcome_) {
      for (v1::WorkerMessage& message : attempt.TakeUnsent()) {
        link_.Send(std::move(message));
      }
    }
  }

  /// Of all attempts what has gathered.
  void SendGathered() {
    gather_.cancel();
    gathers_ = false;
    if (!welcome_) {
      return;  // it goes with the next Welcome
    }
    v1::WorkerMessage message;
    int states = 0;
    for (auto& [id, attempt] : held_) {
      for (v1::StateBatch& batch : attempt.TakeUnsentStates()) {
        if (states > 0 && states + batch.states_size() > kStatesPerMessage) {
          link_.Send(std::exchange(message, {}));
          states = 0;
        }
        states += batch.states_size();
        *message.mutable_gathered()->add_batches() = std::move(batch);
      }
    }
    if (states > 0) {
      link_.Send(std::move(message));
    }
  }

  // ---- attempts ----

  void Take(const v1::Lease& lease) {
    const std::int64_t id = lease.attempt();
    auto [it, added] = held_.try_emplace(id, lease);
    if (!added) {
      return;
    }
    if (lease.model_case() == v1::Lease::MODEL_NOT_SET) {
      EndWithout(it->second, id, v1::Finished::OUTCOME_FAILED, "the lease names no model");
      return;
    }
    if (stopping_ || draining_) {
      EndWithout(it->second, id, v1::Finished::OUTCOME_STOPPED, kLeaving);
      return;
    }
    StartWaiting();
  }

  /// Starts leased attempts while slots are free, the earliest lease first.
  void StartWaiting() {
    int running = 0;
    for (const auto& [id, attempt] : held_) {
      running += attempt.running() ? 1 : 0;
    }
    running += static_cast<int>(ending_.size());
    for (auto& [id, attempt] : held_) {
      if (running >= options_.slots || stopping_) {
        return;
      }
      if (!attempt.started() && !attempt.ended()) {  // one that came while draining has ended
        ++running;
        spdlog::info("start attempt={}", id);
        attempt.Run(
            engines_, programs_,
            [this, id = id](v1::State state) {
              asio::post(io_, [this, id, state = std::move(state)] { Reached(id, state); });
            },
            [this, id = id](v1::Finished finished) {
              asio::post(io_, [this, id, finished = std::move(finished)] { Ended(id, finished); });
            });
      }
    }
  }

  void Reached(std::int64_t id, const v1::State& state) {
    if (const auto found = held_.find(id); found != held_.end()) {
      found->second.AddState(state);
      if (gather_for_.count() == 0) {
        Send(found->second);
      } else if (!std::exchange(gathers_, true)) {
        gather_.expires_after(gather_for_);
        gather_.async_wait([this](const boost::system::error_code& error) {
          if (!error) {
            SendGathered();
          }
        });
      }
    }
  }

  void Ended(std::int64_t id, const v1::Finished& finished) {
    spdlog::info("end attempt={} outcome={} states={} core_seconds={:.3f} reason=\"{}\"", id,
                 v1::Finished::Outcome_Name(finished.outcome()), finished.states(),
                 finished.core_seconds(), finished.reason());
    if (const auto found = held_.find(id); found != held_.end()) {
      found->second.AddEnd(finished);
      if (gathers_) {
        SendGathered();  // the end comes last
      }
      Send(found->second);
    } else {
      ending_.erase(id);  // joins the thread, which has nothing left to do
    }
    StartWaiting();
    FarewellIfStopped();
  }

  void Acknowledged(const v1::Ack& ack) {
    const auto found = held_.find(ack.attempt());
    if (found == held_.end()) {
      return;
    }
    if (ack.refused()) {
      spdlog::info("refused attempt={}", ack.attempt());
      Drop(ack.attempt());
    } else if (ack.finished()) {
      held_.erase(found);
    } else {
      found->second.Acknowledge(ack.up_to());
    }
    StartWaiting();
    LeaveIfDrained();
    FarewellIfStopped();
  }

  /// Nobody wants this attempt any more: nothing of it is sent, its thread ends within a time step.
  void Drop(std::int64_t id) {
    auto node = held_.extract(id);
    if (node.empty()) {
      return;
    }
    node.mapped().Stop();
    if (node.mapped().running()) {
      ending_.insert(std::move(node));
    }
    LeaveIfDrained();
  }

  // ---- leaving ----

  void LeaveIfDrained() {
    if (draining_ && !stopping_ && !leaving_ && held_.empty() && ending_.empty()) {
      spdlog::info("drained");
      Leave();
    }
  }

  void WaitForSignal() {
    signals_.async_wait([this](const boost::system::error_code& error, int /*signal*/) {
      if (error) {
        return;
      }
      if (options_.drain_within.count() > 0 && !std::exchange(told_to_leave_, true)) {
        DrainWithin(options_.drain_within);
        WaitForSignal();
      } else {
        Stop();
      }
    });
  }

  /// Nothing new is begun, what has not begun is given back (the server then leases nothing more),
  /// what still runs at the end of the time is stopped.
  void DrainWithin(std::chrono::milliseconds within) {
    if (stopping_ || leaving_) {
      return;
    }
    spdlog::info("draining running={} within_ms={}", held_.size(), within.count());
    draining_ = true;
    for (auto& [id, attempt] : held_) {
      if (!attempt.started() && !attempt.ended()) {
        EndWithout(attempt, id, v1::Finished::OUTCOME_STOPPED, kLeaving);
      }
    }
    farewell_.expires_after(within);
    farewell_.async_wait([this](const boost::system::error_code& error) {
      if (!error && !stopping_) {
        Stop();
      }
    });
    if (open_) {
      LeaveIfDrained();
    } else if (held_.empty()) {
      Quit();
    }
  }

  /// Simulations stop, their last states and ends are sent.
  void Stop() {
    spdlog::info("stopping held={}", held_.size());
    stopping_ = true;
    reconnect_.cancel();
    for (auto& [id, attempt] : held_) {
      attempt.Leave();
    }
    std::erase_if(held_, [](const auto& item) { return !item.second.started(); });
    farewell_.expires_after(options_.farewell);
    farewell_.async_wait([this](const boost::system::error_code& error) {
      if (!error) {
        Quit();
      }
    });
    FarewellIfStopped();
  }

  void FarewellIfStopped() {
    if (!stopping_ || !ending_.empty()) {
      return;
    }
    for (const auto& [id, attempt] : held_) {
      if (attempt.running()) {
        return;
      }
    }
    if (!open_) {
      Quit();
    } else if (held_.empty() && !leaving_) {
      Leave();
    }
  }

  /// The server ends the stream then, which ends this process.
  void Leave() {
    leaving_ = true;
    v1::WorkerMessage message;
    message.mutable_leaving();
    link_.Send(std::move(message));
    link_.FinishSending();
  }

  void Quit() {
    signals_.cancel();
    heartbeat_.cancel();
    reconnect_.cancel();
    farewell_.cancel();
    gather_.cancel();
    io_.stop();
  }

  const WorkerOptions options_;
  const std::string instance_ = rpc::RandomId();  // the same in every reconnect
  asio::io_context io_;
  asio::signal_set signals_;
  asio::steady_timer heartbeat_;
  asio::steady_timer reconnect_;
  asio::steady_timer farewell_;
  asio::steady_timer gather_;
  rpc::Backoff backoff_{{}};
  std::chrono::milliseconds heartbeat_every_{1000};
  std::chrono::milliseconds gather_for_{0};  // states go together that come within it
  bool gathers_ = false;                     // some wait to be sent
  bool open_ = false;                        // a stream exists
  bool welcome_ = false;                     // and the server has accepted it
  bool draining_ = false;                    // takes nothing new
  bool leaving_ = false;                     // everything is sent, the stream is being closed
  bool told_to_leave_ = false;               // by a signal, which leaves time
  bool stopping_ = false;                    // a signal was caught, or that time is over
  bool said_refusal_ = false;
  bool looks_why_ = false;  // another thread does
  bool said_why_ = false;   // in this outage
  absl::Status result_;
  // Destroyed from the last to the first: simulations end before what they use.
  ServerLink link_;
  Engines engines_;
  Programs programs_;
  std::string checkpoints_;                     // identity of their folder; empty: none are kept
  std::map<std::int64_t, HeldAttempt> ending_;  // dropped, thread on its way out
  std::map<std::int64_t, HeldAttempt> held_;
  std::jthread looking_why_;  // joined first
};

Worker::Worker(WorkerOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}

Worker::~Worker() = default;

absl::Status Worker::Run() { return impl_->Run(); }

}  // namespace calib::worker
