#pragma once
// Contents by digest, in and out, a piece at a time.

#include <grpcpp/support/server_callback.h>

#include <string>

#include "calib/v1/campaign.pb.h"
#include "server/service/core.h"

namespace calib::service {

/// Streams stored content to who has the right; NOT_FOUND when there is none. `request` names it by
/// `digest`.
grpc::ServerWriteReactor<v1::BlobChunk>* SendBlob(Core& core,
                                                  const grpc::ServerContextBase& context,
                                                  Right right,
                                                  const google::protobuf::Message& request,
                                                  const std::string& digest);

/// Stores what arrives from who has the right under its digest, which is checked. It waits in
/// `folder` until it is whole.
grpc::ServerReadReactor<v1::BlobChunk>* ReceiveBlob(Core& core,
                                                    const grpc::ServerContextBase& context,
                                                    Right right, const std::string& folder,
                                                    v1::BlobReceipt* receipt);

}  // namespace calib::service
