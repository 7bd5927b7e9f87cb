#include "tests/fuzz/service_under_fuzz.h"

#include <google/protobuf/stubs/logging.h>
#include <grpcpp/grpcpp.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <future>
#include <iterator>
#include <latch>

#include "proto/rpc/digest.h"
#include "server/service/campaigns_service.h"
#include "tests/fuzz/direct_call.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/support/small_campaign.h"

namespace calib::fuzz {
namespace {

/// Little enough for a thousand inputs a minute.
constexpr service::Limits kSmall{.slots = 16,
                                 .campaigns = 8,
                                 .blob_mib = 1,
                                 .campaign_mib = 1,
                                 .samples = 64,
                                 .readings = 500,
                                 .predictions = 10'000,
                                 .covariance = 50,
                                 .packings = 8,
                                 .grains = 2000};
/// Nothing runs out while an input is tried.
const scheduler::SchedulerOptions kOptions{.lease = std::chrono::hours(1),
                                           .heartbeat = std::chrono::minutes(1),
                                           .most_slots = kSmall.slots,
                                           .most_campaigns = kSmall.campaigns};
/// Threads of each pool of Core: as many tasks that wait for each other are behind all before them.
constexpr int kPoolThreads = 2;

testing::SmallCampaign Prepared() {
  return testing::MakeSmallCampaign({.samples = 8, .max_iterations = 2});
}

/// Goes with the program, unless it crashes: deploy/nightly.d/fuzz gives it a folder that goes too.
class Place {
 public:
  Place() {
    path_ = (std::filesystem::temp_directory_path() / "calib-fuzz-XXXXXX").string();
    Expect(mkdtemp(path_.data()) != nullptr, "there is room for temporary files");
    spdlog::set_level(spdlog::level::off);
    google::protobuf::SetLogHandler(nullptr);
  }
  ~Place() {
    std::error_code error;
    std::filesystem::remove_all(path_, error);
  }
  const std::string& path() const { return path_; }
  std::string Template() const { return path_ + "/template.db"; }
  std::string Database() const { return path_ + "/input.db"; }

 private:
  std::string path_;
};

Place& ThePlace() {
  static Place place;
  return place;
}

std::string BytesOfFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void RemoveDatabase(const std::string& path) {
  for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(path + suffix);
}

void OnStrandOf(service::Core& core, const std::function<void()>& task) {
  std::promise<void> done;
  core.Post([&] {
    task();
    done.set_value();
  });
  done.get_future().wait();
}

std::unique_ptr<service::Core> CoreOver(const std::string& path) {
  auto store = store::Store::Open(path);
  Expect(store.ok(), "a server opens its store: " + std::string(store.status().message()));
  auto core = std::make_unique<service::Core>(
      *std::move(store), service::Guard::Open("", "", "fuzz").value(), kOptions, kSmall,
      [](const absl::Status& status) {
        Expect(false, "no request makes the store fail: " + std::string(status.message()));
      });
  OnStrandOf(*core, [&] {
    const absl::Status status = core->Start();
    Expect(status.ok(), "a server takes up what is stored: " + std::string(status.message()));
  });
  return core;
}

/// Behind all writes so far and what followed from them on the strand.
void AwaitDisk(service::Core& core) {
  std::promise<void> done;
  core.Post([&] {
    core.Write([](store::Transaction&) {},
               [&](const absl::Status& /*written*/) { done.set_value(); });
  });
  done.get_future().wait();
}

/// Behind all plans, and all campaigns that were being read.
void AwaitPools(service::Core& core) {
  std::latch plans(kPoolThreads);
  std::latch parses(kPoolThreads);
  std::latch done(2 * kPoolThreads);
  core.Post([&] {
    for (int k = 0; k < kPoolThreads; ++k) {
      core.Compute([&]() -> std::function<void()> {
        plans.arrive_and_wait();
        return [&] { done.count_down(); };
      });
      core.Load([&]() -> std::function<void()> {
        parses.arrive_and_wait();
        return [&] { done.count_down(); };
      });
    }
  });
  done.wait();
}

void SettleCore(service::Core& core) {
  // A campaign that comes is written, read aside, planned aside, its plan written and taken in.
  for (int k = 0; k < 4; ++k) {
    AwaitDisk(core);
    AwaitPools(core);
  }
  AwaitDisk(core);  // leases are written before they are sent
}

void MakeTemplate(const std::string& path) {
  const testing::SmallCampaign campaign = Prepared();
  auto core = CoreOver(path);
  service::CampaignsService service(*core, {.state_folder = ThePlace().path(), .listen = ""});
  v1::SubmitRequest request;
  request.set_request_id("prepared");
  request.set_campaign_file(campaign.yaml);
  request.set_file_name("small.yaml");
  for (const auto& file : campaign.files) {
    (*request.mutable_files())[file.first] = rpc::Sha256Hex(file.second);
  }
  OnStrandOf(*core, [&] {
    core->Write(
        [&campaign](store::Transaction& transaction) {
          for (const auto& file : campaign.files) {
            transaction.PutBlob(rpc::Sha256Hex(file.second), file.second);
          }
        },
        [](const absl::Status& status) { Expect(status.ok(), "contents are stored"); });
  });
  AwaitDisk(*core);
  grpc::CallbackServerContext context;
  v1::SubmitReply reply;
  const grpc::Status status = DirectUnary().Run(service.Submit(&context, &request, &reply));
  Expect(status.ok() && reply.campaign() == "c1", "the prepared campaign is accepted");
  SettleCore(*core);
  auto reader = core->Read();
  Expect(reader.ok() && reader->Evaluations(1)->size() == 8, "the prepared campaign is planned");
}

}  // namespace

const std::string& ServiceUnderFuzz::Folder() { return ThePlace().path(); }

ServiceUnderFuzz::ServiceUnderFuzz() {
  static const bool made = [] {
    MakeTemplate(ThePlace().Template());
    return true;
  }();
  Expect(made, "there is a store to begin with");
  RemoveDatabase(ThePlace().Database());
  std::filesystem::copy_file(ThePlace().Template(), ThePlace().Database());
  core_ = CoreOver(ThePlace().Database());
}

ServiceUnderFuzz::~ServiceUnderFuzz() {
  core_.reset();
  if (BytesOfFile(ThePlace().Database()) == BytesOfFile(ThePlace().Template())) {
    return;  // nothing was stored: a server has started on it before
  }
  core_ = CoreOver(ThePlace().Database());
  auto reader = core_->Read();
  Expect(reader.ok(), "what is stored can be read");
  const auto campaigns = reader->Campaigns();
  Expect(campaigns.ok(), "campaigns can be read");
  for (const auto& campaign : *campaigns) {
    const auto states = reader->States(campaign.submitted.id);
    Expect(states.ok(), "states can be read");
    for (const store::StateRecord& state : *states) {
      for (const double value : state.observables) {
        Expect(std::isfinite(value), "states that are stored are finite");
      }
    }
  }
}

void ServiceUnderFuzz::OnStrand(const std::function<void()>& task) { OnStrandOf(*core_, task); }

void ServiceUnderFuzz::Settle() { SettleCore(*core_); }

std::string ServiceUnderFuzz::DigestOf(const std::string& word) {
  static const auto files = Prepared().files;
  const auto found = files.find(word + ".txt");
  return found == files.end() ? word : rpc::Sha256Hex(found->second);
}

}  // namespace calib::fuzz
