// What users call: every method of the service Campaigns, through its door, over a store with one
// campaign (service_under_fuzz.h). Pieces of PutBlob that follow each other are one content.
#include "server/service/campaigns_service.h"

#include <array>
#include <functional>

#include "proto/rpc/check_message.h"
#include "tests/fuzz/call_sequence.h"
#include "tests/fuzz/direct_call.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/service_under_fuzz.h"

namespace calib::fuzz {
namespace {

using google::protobuf::Message;
using service::CampaignsService;

/// Messages that a reader of a stream takes before it goes: of Watch the first, of which the next
/// may be long in coming.
constexpr int kMostTaken = 1000;

void CheckReply(const Message& reply) {
  const absl::Status status = rpc::CheckMessage(reply);
  Expect(status.ok(), "an answer keeps its rules: " + std::string(status.message()));
}

void CheckStatus(const grpc::Status& status) {
  Expect(status.ok() || status.error_code() == grpc::StatusCode::CANCELLED ||
             !status.error_message().empty(),
         "a refusal says why");
  for (const auto code :
       {grpc::StatusCode::UNKNOWN, grpc::StatusCode::INTERNAL, grpc::StatusCode::DATA_LOSS}) {
    Expect(status.error_code() != code,
           "no request is answered by a fault of the server: " + status.error_message());
  }
}

using Run = std::function<bool(CampaignsService&, const Message&)>;

template <typename Request, typename Reply>
Run Unary(grpc::ServerUnaryReactor* (CampaignsService::*method)(grpc::CallbackServerContext*,
                                                                const Request*, Reply*)) {
  return [method](CampaignsService& service, const Message& message) {
    grpc::CallbackServerContext context;
    Reply reply;
    const grpc::Status status = DirectUnary().Run(
        (service.*method)(&context, static_cast<const Request*>(&message), &reply));
    CheckStatus(status);
    if (status.ok()) CheckReply(reply);
    return status.ok();
  };
}

template <typename Request, typename Reply>
Run Stream(grpc::ServerWriteReactor<Reply>* (CampaignsService::*method)(
               grpc::CallbackServerContext*, const Request*),
           int most = kMostTaken) {
  return [method, most](CampaignsService& service, const Message& message) {
    grpc::CallbackServerContext context;
    const grpc::Status status = DirectWriter<Reply>().Run(
        (service.*method)(&context, static_cast<const Request*>(&message)), most, CheckReply);
    CheckStatus(status);
    return status.ok() || (status.error_code() == grpc::StatusCode::CANCELLED && most == 1);
  };
}

struct Entry {
  Method method;
  Run run;  ///< empty: PutBlob, which takes several messages
};

template <typename T>
const Message* Default() {
  return &T::default_instance();
}

const std::vector<Entry>& Entries() {
  using S = CampaignsService;
  static const std::vector<Entry> entries = {
      {{"PutBlob", Default<v1::BlobChunk>()}, {}},
      {{"Submit", Default<v1::SubmitRequest>()}, Unary(&S::Submit)},
      {{"List", Default<v1::ListRequest>()}, Unary(&S::List)},
      {{"Show", Default<v1::CampaignRequest>()}, Unary(&S::Show)},
      {{"Watch", Default<v1::CampaignRequest>()}, Stream(&S::Watch, 1)},
      {{"GetPosterior", Default<v1::PosteriorRequest>()}, Unary(&S::GetPosterior)},
      {{"GetSamples", Default<v1::CampaignRequest>()}, Stream(&S::GetSamples)},
      {{"GetStates", Default<v1::StatesRequest>()}, Stream(&S::GetStates)},
      {{"GetSource", Default<v1::CampaignRequest>()}, Unary(&S::GetSource)},
      {{"GetBlob", Default<v1::BlobByDigest>()}, Stream(&S::GetBlob)},
      {{"GetLog", Default<v1::CampaignRequest>()}, Stream(&S::GetLog)},
      {{"AddFinding", Default<v1::AddFindingRequest>()}, Unary(&S::AddFinding)},
      {{"ListFindings", Default<v1::CampaignRequest>()}, Unary(&S::ListFindings)},
      {{"Pause", Default<v1::ControlRequest>()}, Unary(&S::Pause)},
      {{"Resume", Default<v1::ControlRequest>()}, Unary(&S::Resume)},
      {{"Cancel", Default<v1::ControlRequest>()}, Unary(&S::Cancel)},
      {{"Delete", Default<v1::ControlRequest>()}, Unary(&S::Delete)},
      {{"ListWorkers", Default<v1::ListWorkersRequest>()}, Unary(&S::ListWorkers)},
      {{"DrainWorker", Default<v1::DrainRequest>()}, Unary(&S::DrainWorker)},
      {{"Examine", Default<v1::ExamineRequest>()}, Unary(&S::Examine)},
      {{"AddRuns", Default<v1::AddRunsRequest>()}, Unary(&S::AddRuns)},
      {{"GetMetrics", Default<v1::MetricsRequest>()}, Unary(&S::GetMetrics)},
      {{"Prune", Default<v1::PruneRequest>()}, Unary(&S::Prune)},
      {{"SetPriority", Default<v1::PriorityRequest>()}, Unary(&S::SetPriority)},
      {{"SetQuota", Default<v1::QuotaRequest>()}, Unary(&S::SetQuota)},
      {{"ListShares", Default<v1::SharesRequest>()}, Unary(&S::ListShares)},
      {{"Backup", Default<v1::BackupRequest>()}, Stream(&S::Backup)},
  };
  return entries;
}

/// Words in the place of digests (ServiceUnderFuzz::DigestOf).
void Resolve(Message& message) {
  if (auto* submit = dynamic_cast<v1::SubmitRequest*>(&message); submit != nullptr) {
    for (auto& [path, digest] : *submit->mutable_files()) {
      digest = ServiceUnderFuzz::DigestOf(digest);
    }
  } else if (auto* blob = dynamic_cast<v1::BlobByDigest*>(&message); blob != nullptr) {
    blob->set_digest(ServiceUnderFuzz::DigestOf(blob->digest()));
  } else if (auto* finding = dynamic_cast<v1::AddFindingRequest*>(&message); finding != nullptr) {
    finding->set_digest(ServiceUnderFuzz::DigestOf(finding->digest()));
  }
}

bool Put(CampaignsService& service, const std::vector<std::unique_ptr<Message>>& pieces) {
  grpc::CallbackServerContext context;
  v1::BlobReceipt receipt;
  std::size_t next = 0;
  const grpc::Status status = DirectReader<v1::BlobChunk>().Run(service.PutBlob(&context, &receipt),
                                                                [&](v1::BlobChunk& chunk) {
                                                                  if (next == pieces.size())
                                                                    return false;
                                                                  chunk.CopyFrom(*pieces[next++]);
                                                                  return true;
                                                                });
  CheckStatus(status);
  if (status.ok()) CheckReply(receipt);
  return status.ok();
}

}  // namespace

std::span<const Method> Methods() {
  static const std::vector<Method> methods = [] {
    std::vector<Method> all;
    for (const Entry& entry : Entries()) all.push_back(entry.method);
    return all;
  }();
  return methods;
}

}  // namespace calib::fuzz

// NOLINTNEXTLINE(readability-identifier-naming)
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace calib::fuzz;
  const auto calls = CallsOf(TextOf(data, size));
  ServiceUnderFuzz server;
  CampaignsService service(
      server.core(), {.state_folder = ServiceUnderFuzz::Folder(), .listen = "127.0.0.1:7447"});
  last_was_good = !calls.empty();
  std::vector<std::unique_ptr<Message>> pieces;
  const auto put = [&] {
    if (!pieces.empty()) last_was_good = Put(service, pieces) && last_was_good;
    pieces.clear();
  };
  for (const Call& call : calls) {
    const Entry& entry = Entries()[call.method % Entries().size()];
    auto message = MessageOf(call);
    if (message == nullptr) {
      last_was_good = false;
      continue;
    }
    Resolve(*message);
    if (!entry.run) {
      pieces.push_back(std::move(message));
      continue;
    }
    put();
    last_was_good = entry.run(service, *message) && last_was_good;
  }
  put();
  server.Settle();  // before the service goes, which the strand may still call
  return 0;
}
