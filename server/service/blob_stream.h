#pragma once
// Contents by digest, in and out.

#include <grpcpp/support/server_callback.h>

#include <string>

#include "calib/v1/campaign.pb.h"
#include "server/service/core.h"

namespace calib::service {

/// Streams stored content; NOT_FOUND when there is none.
grpc::ServerWriteReactor<v1::BlobChunk>* SendBlob(Core& core, const std::string& digest);

/// Stores what arrives under its digest, which is checked.
grpc::ServerReadReactor<v1::BlobChunk>* ReceiveBlob(Core& core, v1::BlobReceipt* receipt);

}  // namespace calib::service
