#pragma once
// The WorkerLink rpcs: one bidirectional stream per worker, and blobs.

#include <string>
#include <utility>

#include "calib/v1/worker.grpc.pb.h"
#include "server/service/core.h"

namespace calib::service {

/// Its functions are called on any of gRPC's threads; what they do is posted to the strand.
class WorkerLinkService final : public v1::WorkerLink::CallbackService {
 public:
  /// state_folder: where content waits that is on its way into the store.
  WorkerLinkService(Core& core, std::string state_folder)
      : core_(core), state_folder_(std::move(state_folder)) {}

  grpc::ServerBidiReactor<v1::WorkerMessage, v1::ServerMessage>* Connect(
      grpc::CallbackServerContext* context) override;
  grpc::ServerWriteReactor<v1::BlobChunk>* GetBlob(grpc::CallbackServerContext* context,
                                                   const v1::BlobRequest* request) override;
  grpc::ServerReadReactor<v1::BlobChunk>* PutBlob(grpc::CallbackServerContext* context,
                                                  v1::BlobReceipt* reply) override;

 private:
  Core& core_;
  const std::string state_folder_;
};

}  // namespace calib::service
