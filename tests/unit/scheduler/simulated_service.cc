#include "tests/unit/scheduler/simulated_service.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <set>
#include <utility>

#include "dem/registry/catalog.h"
#include "server/campaign/model/sha256.h"
#include "server/planning/history.h"
#include "server/planning/posterior_record.h"
#include "tests/support/smooth_curve.h"

namespace calib::scheduler {
namespace {

constexpr std::chrono::milliseconds kLease(1000);

/// In place of the mechanics; an error of the load cell, where the run has one, reads it larger.
double Model(const v1::AttemptSpec& spec, int load_step, double packing_scatter,
             double repeat_scatter) {
  const auto gain = spec.parameters().find("load_cell_error.gain");
  const double read = gain == spec.parameters().end() ? 1 : 1 + gain->second;
  return read * testing::SmoothCurve(spec, load_step, packing_scatter, repeat_scatter);
}

std::string Bytes(const std::vector<double>& values) {
  std::string bytes(values.size() * sizeof(double), '\0');
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

}  // namespace

void SimulatedPorts::RunOne() {
  if (tasks_.empty()) return;
  const auto task = std::move(tasks_.front());
  tasks_.pop_front();
  task();
}

void SimulatedPorts::Run() {
  while (!tasks_.empty()) RunOne();
}

absl::StatusOr<store::Reader> SimulatedPorts::Read() {
  if (unreadable > 0) {
    --unreadable;
    return absl::ResourceExhaustedError("no file can be opened");
  }
  return store_.Read();
}

void SimulatedPorts::Write(store::Store::Job job, std::function<void(const absl::Status&)> then) {
  tasks_.push_back([this, job = std::move(job), then = std::move(then)] {
    const absl::Status status = store_.WriteNow(job);
    EXPECT_TRUE(status.ok() || absl::IsInvalidArgument(status)) << status;
    refused += status.ok() ? 0 : 1;
    then(status);
  });
}

void SimulatedPorts::Compute(std::function<std::function<void()>()> work) {
  tasks_.push_back([work = std::move(work)] { work()(); });
}

void SimulatedPorts::Send(std::int64_t session, v1::ServerMessage message) {
  inbox[session].push_back(std::move(message));
}

void SimulatedPorts::Close(std::int64_t session, const absl::Status& /*status*/) {
  closed.push_back(session);
}

SimulatedService::SimulatedService(const std::string& name, const campaign::MethodList& methods)
    : methods_(&methods), path_(::testing::TempDir() + "/simulated_" + name + ".db") {
  for (const char* suffix : {"", "-wal", "-shm"}) {
    std::filesystem::remove(path_ + suffix);
  }
  Restart();
}

void SimulatedService::Restart() {
  BeginRestart();
  ports_->Run();
}

void SimulatedService::BeginRestart() {
  const auto now = ports_ == nullptr ? std::chrono::steady_clock::time_point{} : ports_->now;
  scheduler_.reset();
  ports_.reset();
  store_.reset();
  auto opened = store::Store::Open(path_);
  EXPECT_TRUE(opened.ok()) << opened.status();
  store_ = *std::move(opened);
  ports_ = std::make_unique<SimulatedPorts>(*store_);
  ports_->now = now;
  scheduler_ = std::make_unique<Scheduler>(
      *ports_, SchedulerOptions{.lease = kLease,
                                .heartbeat = std::chrono::milliseconds(100),
                                .most_campaigns = kMostCampaigns,
                                .methods = methods_});
  const absl::Status status = scheduler_->Load();
  EXPECT_TRUE(status.ok()) << status;
}

std::string SimulatedService::Submit(const testing::SmallCampaign& campaign,
                                     const std::function<void()>& answered) {
  std::map<std::string, std::string> digests;
  for (const auto& [path, content] : campaign.files) {
    digests[path] = campaign::Sha256Hex(content);
    const auto put = [&digest = digests[path], &content = content](store::Transaction& t) {
      t.PutBlob(digest, content);
    };
    EXPECT_TRUE(store_->WriteNow(put).ok());
  }
  store::Reader reader = Read();
  const auto outcome = campaign::ReadCampaign(*methods_, campaign.yaml, "small.yaml",
                                              planning::StoredFiles(reader, digests));
  EXPECT_TRUE(outcome.problems.empty()) << campaign::ToString(outcome.problems.front());
  std::string id;
  scheduler_->Submit({.name = "small",
                      .yaml = campaign.yaml,
                      .file_name = "small.yaml",
                      .method = outcome.campaign.method->name(),
                      .samples = planning::LargestIteration(outcome.campaign),
                      .max_iterations = outcome.campaign.max_iterations,
                      .owner = owner},
                     digests, "", {}, [&](const absl::StatusOr<std::string>& answer) {
                       id = *answer;
                       if (answered) answered();
                     });
  ports_->Run();
  return id;
}

absl::StatusOr<bool> SimulatedService::AddRuns(const planning::NewRuns& runs) {
  absl::StatusOr<bool> added = absl::UnknownError("no answer");
  scheduler_->AddRuns(runs, [&added](const absl::StatusOr<bool>& answer) { added = answer; });
  ports_->Run();
  return added;
}

std::int64_t SimulatedService::Connect(const std::string& worker, int slots,
                                       const std::vector<std::int64_t>& held) {
  v1::Hello hello = testing::MatchingHello(worker, slots);
  hello.set_checkpoints("folder of " + worker);
  hello.mutable_attempts()->Add(held.begin(), held.end());
  if (dress) dress(hello);
  const absl::Status status = scheduler_->Connected(++last_session_, hello);
  EXPECT_TRUE(status.ok()) << status;
  ports_->Run();
  return last_session_;
}

v1::ServerMessage SimulatedService::Next(std::int64_t session,
                                         v1::ServerMessage::MessageCase kind) {
  auto& inbox = ports_->inbox[session];
  while (!inbox.empty()) {
    v1::ServerMessage message = std::move(inbox.front());
    inbox.pop_front();
    if (message.message_case() == kind) {
      return message;
    }
  }
  return {};
}

v1::StateBatch SimulatedService::States(const v1::Lease& lease, int first, int count) const {
  v1::StateBatch batch;
  batch.set_attempt(lease.attempt());
  batch.set_first(first);
  const std::size_t width = dem::FindTest(lease.spec().test())->observables.size();
  for (int i = first; i < first + count; ++i) {
    v1::State& state = *batch.add_states();
    state.set_load_step(i);
    for (std::size_t k = 0; k < width; ++k) {
      state.add_values(Model(lease.spec(), i, packing_scatter, repeat_scatter));
    }
  }
  return batch;
}

void SimulatedService::SendStates(std::int64_t session, const v1::Lease& lease, int first,
                                  int count) {
  scheduler_->Receive(session, States(lease, first, count));
  ports_->Run();
}

void SimulatedService::SendEnd(std::int64_t session, std::int64_t attempt,
                               v1::Finished::Outcome outcome, const std::string& reason) {
  v1::Finished finished;
  finished.set_attempt(attempt);
  finished.set_outcome(outcome);
  finished.set_reason(reason);
  finished.set_core_seconds(core_seconds);
  scheduler_->Receive(session, finished);
  ports_->Run();
}

void SimulatedService::Advance(std::chrono::milliseconds time) {
  constexpr std::chrono::milliseconds kTick = kLease / 4;  // as Core
  for (auto left = time; left.count() > 0; left -= kTick) {
    StandStill(std::min(left, kTick));
  }
}

void SimulatedService::StandStill(std::chrono::milliseconds time) {
  ports_->now += time;
  scheduler_->Tick();
  ports_->Run();
}

store::CampaignRecord SimulatedService::Campaign() { return *Read().Campaign(1); }

void SimulatedService::Absorb(Simulated& worker) {
  for (auto& inbox = ports_->inbox[worker.session]; !inbox.empty(); inbox.pop_front()) {
    const v1::ServerMessage& message = inbox.front();
    if (message.has_lease()) {
      worker.busy[message.lease().attempt()] = {.lease = message.lease()};
    } else if (message.has_stop()) {
      worker.busy.erase(message.stop().attempt());
    } else if (message.has_ack() && (message.ack().refused() || message.ack().finished())) {
      worker.busy.erase(message.ack().attempt());
    }
  }
}

void SimulatedService::Step(Simulated& worker, std::mt19937& random) {
  Absorb(worker);
  if (worker.busy.empty()) {
    return;
  }
  auto chosen = worker.busy.begin();
  std::advance(chosen, random() % worker.busy.size());
  Busy& busy = chosen->second;
  const auto& path = busy.lease.spec().path();
  const int all =
      static_cast<int>(std::count_if(path.begin(), path.end(), [](const v1::ControlPoint& point) {
        return point.load_step() >= 0;
      }));
  // Load steps are numbered from 0 here.
  const int until = busy.lease.has_rest_after() ? busy.lease.rest_after() + 1 : all;
  if (fails && busy.sent > 0 && fails(busy.lease.spec())) {
    SendEnd(worker.session, busy.lease.attempt(), v1::Finished::OUTCOME_MODEL_FAILED,
            "ended by SIGSEGV");
    return;
  }
  if (busy.sent < until) {
    const int count = 1 + static_cast<int>(random() % static_cast<unsigned>(until - busy.sent));
    SendStates(worker.session, busy.lease, busy.sent, count);
    busy.sent += count;
    return;
  }
  const int begun = busy.lease.run().empty() ? 0 : worker.resting[busy.lease.run()];
  computed += busy.sent - begun;
  if (busy.lease.has_rest_after()) {
    worker.resting[busy.lease.run()] = until;
    SendEnd(worker.session, busy.lease.attempt(), v1::Finished::OUTCOME_RESTING);
  } else {
    SendEnd(worker.session, busy.lease.attempt(), v1::Finished::OUTCOME_COMPLETED);
  }
}

void SimulatedService::RunToEnd(unsigned seed, bool calm) {
  std::mt19937 random(seed);
  std::vector<Simulated> workers(calm ? 1 : 3);
  const auto name = [](std::size_t i) { return "w" + std::to_string(i); };
  const auto connect = [&](std::size_t i) {
    std::vector<std::int64_t> held;
    for (auto& [attempt, busy] : workers[i].busy) {
      held.push_back(attempt);
      busy.sent = 0;  // nothing was acknowledged for certain: all of it again
    }
    workers[i].session = Connect(name(i), 2, held);
  };
  for (std::size_t i = 0; i < workers.size(); ++i) {
    connect(i);
  }
  bool read_all = true;
  for (int step = 0; step < 100'000 && scheduler_->live() > 0; ++step) {
    if (read_all && step % 8 == 0) CompareCounts();
    const std::size_t i = random() % workers.size();
    const unsigned trouble = calm ? 1000 : random() % 100;
    if (trouble == 0) {  // killed and started again
      workers[i].busy.clear();
      if (random() % 2 == 0) workers[i].resting.clear();  // and its folder with it
      scheduler_->Disconnected(workers[i].session);
      connect(i);
    } else if (trouble == 1) {  // the stream is cut
      scheduler_->Disconnected(workers[i].session);
      connect(i);
    } else if (trouble == 2) {  // silent past its lease
      Advance(std::chrono::milliseconds(1100));
      for (Simulated& worker : workers) {
        EXPECT_TRUE(scheduler_->Receive(worker.session, v1::Heartbeat()).ok());
      }
      ports_->Run();
    } else if (trouble == 4) {  // the store cannot be read for a while
      ports_->unreadable = 3;
      read_all = false;         // memory waits for what it could not read
    } else if (trouble == 3) {  // the server is killed
      Restart();
      for (std::size_t k = 0; k < workers.size(); ++k) {
        connect(k);
      }
    } else {
      Step(workers[i], random);
    }
  }
  EXPECT_EQ(Campaign().progress.state, store::CampaignState::kFinished)
      << Campaign().progress.reason;
  EXPECT_EQ(ports_->refused, 0);
}

void SimulatedService::CompareCounts() {
  store::Reader reader = Read();
  for (const auto& [id, live] : scheduler_->AllLive()) {
    const store::CampaignRecord record = Value(reader.Campaign(id));
    EXPECT_EQ(live.iteration, record.progress.iteration);
    std::map<int, campaign::SampleStatus> samples;
    const int first = live.iteration * record.submitted.samples;
    EXPECT_TRUE(reader
                    .EachStatus(id, first, first + record.submitted.samples - 1,
                                [&](int sample, store::EvaluationStatus status, bool rests) {
                                  samples[sample].Add(status, rests);
                                })
                    .ok());
    campaign::SampleCounts counts;
    for (const auto& [sample, status] : samples) counts.Add(status);
    EXPECT_EQ(live.counts, counts) << "c" << id << ", iteration " << live.iteration;
  }
}

SimulatedService::Shift SimulatedService::RunTimed(int workers,
                                                   const std::function<double(int)>& seconds) {
  struct Timed {
    std::int64_t session = 0;
    v1::Lease lease;
    int sent = 0;
    double begun = 0;
    bool busy = false;
  };
  Shift shift;
  const Clock::time_point start = ports_->now;
  std::vector<Timed> team(static_cast<std::size_t>(workers));
  for (std::size_t i = 0; i < team.size(); ++i) {
    team[i].session = Connect("w" + std::to_string(i), 1);
  }
  const auto take = [&](Timed& worker) {
    for (auto& inbox = ports_->inbox[worker.session]; !inbox.empty(); inbox.pop_front()) {
      const v1::ServerMessage& message = inbox.front();
      if (message.has_stop() && worker.busy) {
        shift.computing += shift.elapsed - worker.begun;
        worker.busy = false;
      } else if (message.has_lease()) {
        worker = {.session = worker.session,
                  .lease = message.lease(),
                  .begun = shift.elapsed,
                  .busy = true};
      }
    }
  };
  const auto steps = [](const v1::Lease& lease) {
    const auto& path = lease.spec().path();
    return static_cast<int>(std::count_if(
        path.begin(), path.end(), [](const v1::ControlPoint& p) { return p.load_step() >= 0; }));
  };
  while (scheduler_->live() > 0) {
    Timed* next = nullptr;
    double at = 0;
    for (Timed& worker : team) {
      take(worker);
      if (!worker.busy) continue;
      const double due = worker.begun + seconds(static_cast<int>(worker.lease.attempt())) *
                                            (worker.sent + 1) / steps(worker.lease);
      if (next == nullptr || due < at) {
        next = &worker;
        at = due;
      }
    }
    if (next == nullptr) break;
    shift.elapsed = at;
    ports_->now = start + std::chrono::duration_cast<Clock::duration>(
                              std::chrono::duration<double>(shift.elapsed));
    for (const Timed& worker : team) {  // nobody falls silent, whatever a run takes
      v1::Heartbeat heartbeat;
      if (worker.busy) heartbeat.add_attempts(worker.lease.attempt());
      EXPECT_TRUE(scheduler_->Receive(worker.session, heartbeat).ok());
    }
    SendStates(next->session, next->lease, next->sent++, 1);
    take(*next);
    if (next->busy && next->sent == steps(next->lease)) {
      shift.computing += shift.elapsed - next->begun;
      next->busy = false;
      SendEnd(next->session, next->lease.attempt(), v1::Finished::OUTCOME_COMPLETED);
    }
  }
  EXPECT_EQ(Campaign().progress.state, store::CampaignState::kFinished)
      << Campaign().progress.reason;
  return shift;
}

std::string SimulatedService::Fingerprint() {
  store::Reader reader = Read();
  std::string text;
  for (const store::IterationRecord& iteration : Value(reader.Iterations(1))) {
    text += iteration.proposal + iteration.posterior.value_or("none") + "\n";
  }
  return text + Runs(1);
}

std::string SimulatedService::Runs(std::int64_t campaign) {
  store::Reader reader = Read();
  std::string text;
  for (const store::SampleRecord& sample : Value(reader.Samples(campaign))) {
    text += std::to_string(sample.sample) + Bytes(sample.parameters) +
            Bytes({sample.log_weight, sample.log_likelihood}) + "\n";
  }
  for (const store::EvaluationRecord& evaluation : Value(reader.Evaluations(campaign))) {
    text += ToString(evaluation.status) + evaluation.reason + "\n";
  }
  for (const store::StateRecord& state : Value(reader.States(campaign))) {
    text += std::to_string(state.key.sample) + " " + std::to_string(state.load_step) +
            Bytes(state.observables) + "\n";
  }
  return text;
}

std::vector<store::SampleRecord> SamplesRun(SimulatedService& service) {
  std::set<int> run;
  for (const store::EvaluationRecord& evaluation : Value(service.Read().Evaluations(1))) {
    if (evaluation.status == store::EvaluationStatus::kFinished) run.insert(evaluation.key.sample);
  }
  std::vector<store::SampleRecord> samples = Value(service.Read().Samples(1));
  std::erase_if(samples, [&run](const auto& sample) { return run.count(sample.sample) == 0; });
  return samples;
}

v1::Posterior LastPosterior(SimulatedService& service) {
  v1::Posterior last;
  for (const store::IterationRecord& iteration : Value(service.Read().Iterations(1))) {
    if (iteration.posterior.has_value()) last = *planning::PosteriorFromJson(*iteration.posterior);
  }
  return last;
}

}  // namespace calib::scheduler
