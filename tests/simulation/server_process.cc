#include "tests/simulation/server_process.h"

#include <algorithm>
#include <atomic>
#include <future>
#include <memory>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/model/sha256.h"
#include "server/service/submission.h"

namespace calib::simulation {

ServerProcess::~ServerProcess() {
  scheduler_.reset();
  store_.reset();
}

absl::Status ServerProcess::Start(const std::string& path, scheduler::SchedulerOptions options) {
  ASSIGN_OR_RETURN(store_, store::Store::Open(path, {.between_tries = milliseconds(1)}));
  lease_ = options.lease;
  scheduler_ = std::make_unique<scheduler::Scheduler>(*this, options);
  tidying_ = std::make_unique<service::Tidying>(service::Tidying::Site{
      .write =
          [this](store::Store::Job job, std::function<void(const absl::Status&)> then) {
            writes_.push_back({std::move(job), std::move(then), false});
          },
      .read = [this] { return Read(); },
      .aside = [this](Work work) { loads_.push_back(std::move(work)); },
      .after = [this](std::chrono::steady_clock::duration /*pause*/,
                      std::function<void()> task) { pauses_.push_back(std::move(task)); },
      .unix_ms = [this] { return UnixMs(); }});
  RETURN_IF_ERROR(scheduler_->Load());
  tick_ = clocks_.now + lease_ / 4;
  tidying_->Begin();
  return absl::OkStatus();
}

void ServerProcess::WriteAll() {
  while (!writes_.empty() && !failed_) Commit(writes_.size());
}

void ServerProcess::RunTask() {
  const auto task = std::move(strand_.front());
  strand_.pop_front();
  of_tick_ = false;
  task();
  watcher_.AfterTask(of_tick_);
}

std::vector<absl::Status> ServerProcess::CommitTogether(std::vector<Waiting>& group) {
  std::vector<absl::Status> statuses(group.size());
  // While the store is busy with this, what is asked for waits for the next commit.
  std::promise<void> begun;
  std::promise<void> all_asked;
  const auto is_busy = std::make_shared<std::atomic<bool>>(false);
  const auto say_busy = [&begun, is_busy] {
    if (!is_busy->exchange(true)) begun.set_value();
  };
  store_->Write(
      [say_busy, asked = all_asked.get_future().share()](store::Transaction&) {
        say_busy();
        asked.wait();
      },
      [say_busy](const absl::Status&) { say_busy(); });
  begun.get_future().wait();
  std::promise<void> done;
  std::size_t left = group.size();
  for (std::size_t i = 0; i < group.size(); ++i) {
    const auto then = [&statuses, &left, &done, i](const absl::Status& status) {
      statuses[i] = status;
      if (--left == 0) done.set_value();
    };
    if (group[i].waits_for_room) {
      store_->Write(std::move(group[i].job), then);
    } else {
      store_->WriteIfRoom(std::move(group[i].job), then);
    }
  }
  all_asked.set_value();
  done.get_future().wait();
  return statuses;
}

void ServerProcess::Commit(std::size_t most) {
  std::vector<Waiting> group;
  while (!writes_.empty() && group.size() < most) {
    if (faults_.reorders_writes && writes_.size() > 1 && dice_.OnceIn(4)) {
      std::swap(writes_[0], writes_[1]);
    }
    group.push_back(std::move(writes_.front()));
    writes_.pop_front();
  }
  if (group.empty()) return;
  const std::vector<absl::Status> statuses = CommitTogether(group);
  for (std::size_t i = 0; i < group.size(); ++i) {
    watcher_.Wrote(statuses[i]);
    strand_.push_back([this, status = statuses[i], then = std::move(group[i].then)] {
      if (!status.ok() && !absl::IsInvalidArgument(status) && !absl::IsResourceExhausted(status)) {
        failed_ = true;
      }
      then(status);
    });
  }
}

void ServerProcess::Begin(std::deque<Work>& queue, std::size_t i) {
  const Work work = std::move(queue[i]);
  queue.erase(queue.begin() + static_cast<std::ptrdiff_t>(i));
  results_.push_back(work());
}

void ServerProcess::Tell(std::size_t i) {
  strand_.push_back(std::move(results_[i]));
  results_.erase(results_.begin() + static_cast<std::ptrdiff_t>(i));
}

void ServerProcess::PostTick() {
  tick_ = clocks_.now + lease_ / 4;
  strand_.push_back([this] {
    of_tick_ = true;
    if (!failed_) scheduler_->Tick();
  });
}

void ServerProcess::EndPause() {
  strand_.push_back(std::move(pauses_.front()));
  pauses_.pop_front();
}

// ---- streams, as service/worker_link_service.cc has them ----

void ServerProcess::Accept(const std::shared_ptr<Stream>& stream) {
  strand_.push_back([this, stream] {
    stream->session = ++last_session_;
    sessions_[stream->session] = stream;
  });
}

bool ServerProcess::MayRead(const Stream& stream) const {
  if (stream.takes || stream.ended.has_value() || stream.server_left) return false;
  return stream.up.empty() ? stream.cut || stream.has_said_all
                           : stream.up.front().due <= clocks_.now;
}

void ServerProcess::ReadFrom(const std::shared_ptr<Stream>& stream) {
  if (stream->up.empty()) {
    stream->ended = absl::OkStatus();  // the worker has said all it had to say, or is gone
    return;
  }
  stream->takes = true;
  strand_.push_back([this, stream, message = std::move(stream->up.front().message)] {
    stream->takes = false;
    const absl::Status status =
        failed_ ? absl::UnavailableError("the store cannot be written") : Take(*stream, message);
    if (!status.ok()) Close(stream->session, status);
  });
  stream->up.pop_front();
}

absl::Status ServerProcess::Take(Stream& stream, const v1::WorkerMessage& message) {
  watcher_.Takes(stream, message);
  if (stream.name.empty()) {
    if (!message.has_hello()) {
      return absl::InvalidArgumentError("the first message must be Hello");
    }
    RETURN_IF_ERROR(scheduler_->Connected(stream.session, message.hello()));
    stream.name = message.hello().name();
    return absl::OkStatus();
  }
  switch (message.message_case()) {
    case v1::WorkerMessage::kStates:
      scheduler_->Receive(stream.session, message.states());
      break;
    case v1::WorkerMessage::kGathered:
      scheduler_->Receive(stream.session, message.gathered());
      break;
    case v1::WorkerMessage::kFinished:
      scheduler_->Receive(stream.session, message.finished());
      break;
    case v1::WorkerMessage::kHeartbeat:
      return scheduler_->Receive(stream.session, message.heartbeat());
    case v1::WorkerMessage::kLeaving:
      scheduler_->Receive(stream.session, message.leaving());
      break;
    default:
      return absl::InvalidArgumentError("a message out of turn");
  }
  return absl::OkStatus();
}

bool ServerProcess::MayForget(const Stream& stream) const {
  return stream.ended.has_value() && !stream.server_left && !stream.takes;
}

void ServerProcess::Forget(const std::shared_ptr<Stream>& stream) {
  stream->server_left = true;
  strand_.push_back([this, stream] {
    sessions_.erase(stream->session);
    scheduler_->Disconnected(stream->session);
  });
}

void ServerProcess::Send(std::int64_t session, v1::ServerMessage message) {
  const auto found = sessions_.find(session);
  if (found == sessions_.end()) return;
  Stream& stream = *found->second;
  watcher_.Sends(stream, message);
  if (stream.ended.has_value() || stream.cut) return;
  Time due = clocks_.now + watcher_.Delay();
  if (!stream.down.empty()) due = std::max(due, stream.down.back().due);
  stream.down.push_back({due, std::move(message)});
}

void ServerProcess::Close(std::int64_t session, const absl::Status& status) {
  const auto found = sessions_.find(session);
  if (found == sessions_.end() || found->second->ended.has_value()) return;
  Stream& stream = *found->second;
  stream.ended = status;
  if (!status.ok() && stream.down.size() > 1) {  // what is not on its way is dropped
    stream.down.resize(
        static_cast<std::size_t>(dice_.Between(1, static_cast<int>(stream.down.size()))));
  }
}

void ServerProcess::Write(store::Store::Job job, std::function<void(const absl::Status&)> then) {
  if (faults_.acknowledges_early) {
    strand_.push_back([then = std::move(then)] { then(absl::OkStatus()); });
    then = [](const absl::Status&) {};
  }
  writes_.push_back({std::move(job), std::move(then), true});
}

absl::StatusOr<store::Reader> ServerProcess::Read() {
  if (unreadable > 0) {
    --unreadable;
    return absl::ResourceExhaustedError("no file can be opened");
  }
  return store_->Read();
}

// ---- people ----

void ServerProcess::Ask(const Wish& wish, const Answer& answer) {
  if (failed_) {
    answer(absl::UnavailableError("the store cannot be written"));
  } else if (wish.verb == "submit") {
    // Its files first, each a call of its own.
    Write(
        [files = wish.files](store::Transaction& transaction) {
          for (const auto& [path, content] : files) {
            transaction.PutBlob(campaign::Sha256Hex(content), content);
          }
        },
        [this, wish, answer](const absl::Status& put) {
          if (put.ok()) {
            Submit(wish, answer);
          } else {
            answer(put);
          }
        });
  } else if (wish.verb == "quota") {
    scheduler_->SetQuota(wish.owner,
                         wish.number < 0 ? std::nullopt : std::optional<int>(wish.number),
                         [answer](const absl::Status& status) {
                           answer(status.ok() ? absl::StatusOr<std::string>("") : status);
                         });
  } else if (wish.verb == "add_runs") {
    scheduler_->AddRuns(wish.runs, [answer](const absl::StatusOr<bool>& added) {
      answer(added.ok() ? absl::StatusOr<std::string>("") : added.status());
    });
  } else {
    Control(wish, answer);
  }
}

void ServerProcess::Submit(const Wish& wish, const Answer& answer) {
  v1::SubmitRequest request;
  request.set_campaign_file(wish.yaml);
  request.set_file_name("small.yaml");
  request.set_request_id(wish.key);
  for (const auto& [path, content] : wish.files) {
    (*request.mutable_files())[path] = campaign::Sha256Hex(content);
  }
  loads_.push_back([this, wish, answer, request]() -> std::function<void()> {
    auto reader = Read();
    using Checked = absl::StatusOr<std::variant<store::NewCampaign, v1::SubmitReply>>;
    auto checked = std::make_shared<Checked>(
        reader.ok() ? service::CheckSubmission(request, service::Limits(), *reader)
                    : Checked(reader.status()));
    return [this, wish, answer, request, checked] {
      auto latest = Read();
      if (!checked->ok() || !latest.ok()) {
        answer(checked->ok() ? latest.status() : checked->status());
        return;
      }
      const auto* accepted = std::get_if<store::NewCampaign>(&**checked);
      if (accepted == nullptr) {
        answer(absl::InternalError(
            std::get<v1::SubmitReply>(**checked).problems(0).ShortDebugString()));
        return;
      }
      const store::RequestRecord record{.digest = service::ContentDigest(request)};
      const auto before = requests_.Begin(wish.key, record.digest, *latest);
      if (!before.ok() || before->has_value()) {
        answer(before.ok() ? absl::StatusOr<std::string>(**before) : before.status());
        return;
      }
      store::NewCampaign submitted = *accepted;
      submitted.owner = wish.owner;
      submitted.created_unix_ms = UnixMs();
      scheduler_->Submit(std::move(submitted), {request.files().begin(), request.files().end()},
                         wish.key, record,
                         [this, answer, key = wish.key](const absl::StatusOr<std::string>& id) {
                           requests_.Done(key);
                           answer(id);
                         });
    };
  });
}

void ServerProcess::Control(const Wish& wish, const Answer& answer) {
  auto reader = Read();
  if (!reader.ok()) {
    answer(reader.status());
    return;
  }
  const std::string digest = absl::StrCat(wish.verb, " ", wish.number, " c", wish.campaign);
  const auto before = requests_.Begin(wish.key, digest, *reader);
  if (!before.ok() || before->has_value()) {
    answer(before.ok() ? absl::StatusOr<std::string>("") : before.status());
    return;
  }
  const scheduler::Scheduler::Reply reply = [this, answer,
                                             key = wish.key](const absl::Status& status) {
    requests_.Done(key);
    answer(status.ok() ? absl::StatusOr<std::string>("") : status);
  };
  if (const auto record = reader->Campaign(wish.campaign); !record.ok()) {
    reply(record.status());
    return;
  }
  const store::Store::Job remember = [key = wish.key, digest](store::Transaction& transaction) {
    transaction.PutRequest(key, {.digest = digest});
  };
  if (wish.verb == "pause") {
    scheduler_->Pause(wish.campaign, remember, reply);
  } else if (wish.verb == "resume") {
    scheduler_->Resume(wish.campaign, remember, reply);
  } else if (wish.verb == "cancel") {
    scheduler_->Cancel(wish.campaign, remember, reply);
  } else if (wish.verb == "priority") {
    scheduler_->SetPriority({.campaign = wish.campaign, .priority = wish.number}, remember, reply);
  } else {
    scheduler_->Delete(wish.campaign, remember, [this, reply](const absl::Status& status) {
      reply(status);
      if (status.ok()) tidying_->Begin();
    });
  }
}

}  // namespace calib::simulation
