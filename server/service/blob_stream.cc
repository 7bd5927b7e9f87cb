#include "server/service/blob_stream.h"

#include <memory>
#include <utility>

#include "calib/return_if_error.h"
#include "proto/rpc/chunking.h"
#include "proto/rpc/status.h"
#include "server/service/stream_reactor.h"

namespace calib::service {
namespace {

class BlobReceiver final : public grpc::ServerReadReactor<v1::BlobChunk> {
 public:
  BlobReceiver(Core& core, v1::BlobReceipt* receipt) : core_(core), receipt_(receipt) {
    StartRead(&chunk_);
  }

  void OnReadDone(bool ok) override {
    if (!ok) {
      Store();
      return;
    }
    if (const absl::Status status = assembler_.Add(chunk_); !status.ok()) {
      Finish(rpc::ToGrpc(status));
      return;
    }
    StartRead(&chunk_);
  }

  void OnDone() override { delete this; }

 private:
  void Store() {
    auto content = assembler_.Finish();
    if (!content.ok()) {
      Finish(rpc::ToGrpc(content.status()));
      return;
    }
    receipt_->set_digest(assembler_.digest());
    receipt_->set_size(static_cast<std::int64_t>(content->size()));
    core_.Post([this, shared = std::make_shared<std::string>(*std::move(content))] {
      if (!core_.health().ok()) {
        Finish(rpc::ToGrpc(core_.health()));
        return;
      }
      core_.Write([digest = assembler_.digest(), shared](
                      store::Transaction& transaction) { transaction.PutBlob(digest, *shared); },
                  [this](const absl::Status& status) { Finish(rpc::ToGrpc(status)); });
    });
  }

  Core& core_;
  v1::BlobReceipt* receipt_;
  v1::BlobChunk chunk_;
  rpc::BlobAssembler assembler_;
};

}  // namespace

grpc::ServerWriteReactor<v1::BlobChunk>* SendBlob(Core& core, const std::string& digest) {
  return new StreamReactor<v1::BlobChunk>(
      core, [&core, digest]() -> absl::StatusOr<std::vector<v1::BlobChunk>> {
        ASSIGN_OR_RETURN(auto reader, core.Read());
        ASSIGN_OR_RETURN(const auto content, reader.Blob(digest));
        return rpc::ToChunks(content);
      });
}

grpc::ServerReadReactor<v1::BlobChunk>* ReceiveBlob(Core& core, v1::BlobReceipt* receipt) {
  return new BlobReceiver(core, receipt);
}

}  // namespace calib::service
