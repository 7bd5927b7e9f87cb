#pragma once
// The WorkerLink rpcs: one bidirectional stream per worker, and blobs.

#include "calib/v1/worker.grpc.pb.h"
#include "server/service/core.h"

namespace calib::service {

/// Its functions are called on any of gRPC's threads; what they do is posted to the strand.
class WorkerLinkService final : public v1::WorkerLink::CallbackService {
 public:
  explicit WorkerLinkService(Core& core) : core_(core) {}

  grpc::ServerBidiReactor<v1::WorkerMessage, v1::ServerMessage>* Connect(
      grpc::CallbackServerContext* context) override;
  grpc::ServerWriteReactor<v1::BlobChunk>* GetBlob(grpc::CallbackServerContext* context,
                                                   const v1::BlobRequest* request) override;

 private:
  Core& core_;
};

}  // namespace calib::service
