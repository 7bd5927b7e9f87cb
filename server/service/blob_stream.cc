#include "server/service/blob_stream.h"

#include <memory>
#include <utility>

#include "calib/return_if_error.h"
#include "proto/rpc/chunking.h"
#include "proto/rpc/status.h"
#include "server/service/calls.h"
#include "server/service/spool.h"
#include "server/service/stream_reactor.h"

namespace calib::service {
namespace {

class BlobReceiver final : public grpc::ServerReadReactor<v1::BlobChunk> {
 public:
  BlobReceiver(Core& core, Entry entry, std::unique_ptr<Spool> spool, v1::BlobReceipt* receipt)
      : core_(core), entry_(std::move(entry)), spool_(std::move(spool)), receipt_(receipt) {
    StartRead(&chunk_);
  }

  void OnReadDone(bool ok) override {
    if (!ok) {
      Store();
      return;
    }
    absl::Status status = core_.door().Check(entry_.caller.peer, chunk_);
    if (status.ok()) {
      status = spool_->Add(chunk_);
    }
    if (!status.ok()) {
      Finish(rpc::ToGrpc(status));
      return;
    }
    StartRead(&chunk_);
  }

  void OnDone() override { delete this; }

 private:
  void Store() {
    if (const absl::Status status = spool_->Finish(); !status.ok()) {
      Finish(rpc::ToGrpc(status));
      return;
    }
    receipt_->set_digest(spool_->digest());
    receipt_->set_size(spool_->bytes());
    core_.Post([this] {
      if (const absl::Status why = core_.WhyNotStore(); !why.ok()) {
        Finish(rpc::ToGrpc(why));
        return;
      }
      core_.WriteIfRoom(
          [spool = spool_](store::Transaction& transaction) {
            transaction.PutBlob(
                spool->digest(), spool->bytes(),
                [&spool](std::int64_t from, std::span<char> to) { return spool->Read(from, to); });
          },
          [this](const absl::Status& status) {
            if (status.ok()) {
              LogChange("put", spool_->digest(), entry_.caller);
            }
            Finish(rpc::ToGrpc(status));
          });
    });
  }

  Core& core_;
  const Entry entry_;
  const std::shared_ptr<Spool> spool_;
  v1::BlobReceipt* receipt_;
  v1::BlobChunk chunk_;
};

}  // namespace

grpc::ServerWriteReactor<v1::BlobChunk>* SendBlob(Core& core,
                                                  const grpc::ServerContextBase& context,
                                                  Right right,
                                                  const google::protobuf::Message& request,
                                                  const std::string& digest) {
  auto entry = AdmitWithBlob(core, context, right, &request);
  if (!entry.ok()) {
    return new EndedCall<grpc::ServerWriteReactor<v1::BlobChunk>>(entry.status());
  }
  return new StreamReactor<v1::BlobChunk>(
      core, std::move(entry->pass), &Core::Query,
      [&core, digest,
       sent = std::int64_t{0}]() mutable -> absl::StatusOr<std::vector<v1::BlobChunk>> {
        ASSIGN_OR_RETURN(auto reader, core.Read());
        ASSIGN_OR_RETURN(auto piece, reader.BlobPiece(digest, sent, rpc::kChunkBytes));
        if (piece.empty() && sent > 0) {
          return std::vector<v1::BlobChunk>();
        }
        std::vector<v1::BlobChunk> chunks(1);
        if (sent == 0) chunks.front().set_digest(digest);
        sent += piece.empty() ? 1 : static_cast<std::int64_t>(piece.size());
        chunks.front().set_data(std::move(piece));
        return chunks;
      });
}

grpc::ServerReadReactor<v1::BlobChunk>* ReceiveBlob(Core& core,
                                                    const grpc::ServerContextBase& context,
                                                    Right right, const std::string& folder,
                                                    v1::BlobReceipt* receipt) {
  using Reactor = grpc::ServerReadReactor<v1::BlobChunk>;
  auto entry = AdmitWithBlob(core, context, right, nullptr);
  if (!entry.ok()) {
    return new EndedCall<Reactor>(entry.status());
  }
  auto spool = Spool::Open(folder, core.door().limits().blob_mib << 20);
  if (!spool.ok()) {
    return new EndedCall<Reactor>(spool.status());
  }
  return new BlobReceiver(core, *std::move(entry), *std::move(spool), receipt);
}

}  // namespace calib::service
