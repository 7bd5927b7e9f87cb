#include "server/service/server.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/resource_quota.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <future>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/strings/str_cat.h"
#include "absl/synchronization/mutex.h"
#include "calib/return_if_error.h"
#include "proto/rpc/address.h"
#include "proto/rpc/client_options.h"
#include "server/access/certificate.h"
#include "server/access/secret.h"
#include "server/service/campaigns_service.h"
#include "server/service/core.h"
#include "server/service/guard.h"
#include "server/service/listener.h"
#include "server/service/state_folder.h"
#include "server/service/upkeep/backup.h"
#include "server/service/worker_link_service.h"

namespace calib::service {
namespace {

constexpr int kKeepaliveMs = 20'000;
constexpr int kFastestPingMs = 5'000;
/// Until a connection has said that it speaks HTTP/2.
constexpr int kHandshakeMs = 20'000;
/// A campaign file of a MiB and the names of its files; everything else is smaller
/// (proto/README.md).
constexpr int kLargestMessage = 2 * 1024 * 1024;
/// Of a stream that has come in and was not taken yet [bytes]: without a bound of its own gRPC
/// holds some 16 MB of each, as the network would have it.
constexpr int kUnreadBytes = 512 * 1024;
/// Each question for the schema holds one for as long as it is open; what the service itself does
/// holds none.
constexpr int kReflectionThreads = 16;
/// Files that are no connections: the database, its readers, uploads, the log.
constexpr std::int64_t kOtherFiles = 200;
constexpr std::chrono::seconds kDefaultShutdown{5};

/// Between looks at the files of the certificate [s].
constexpr unsigned kCertificateAgain = 1;

/// Callers show a certificate; the guard judges it (guard.h), so that it can say in a sentence what
/// is wrong with it, and do so for as long as a connection lasts.
std::shared_ptr<grpc::ServerCredentials> CredentialsOf(const std::string& tls) {
  if (tls.empty()) {
    return grpc::InsecureServerCredentials();
  }
  grpc::experimental::TlsServerCredentialsOptions options(
      std::make_shared<grpc::experimental::FileWatcherCertificateProvider>(
          tls + "/key.pem", tls + "/cert.pem", tls + "/ca.pem", kCertificateAgain));
  options.watch_root_certs();
  options.watch_identity_key_cert_pairs();
  options.set_cert_request_type(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_BUT_DONT_VERIFY);
  return grpc::experimental::TlsServerCredentials(options);
}

/// What is wrong with how a server is to be reached; OK: nothing.
absl::Status CheckReach(const ServerOptions& options) {
  if (options.tls.empty()) {
    if (options.listen.empty() || rpc::IsLoopback(options.listen) || options.insecure) {
      return absl::OkStatus();
    }
    return absl::InvalidArgumentError(absl::StrCat(
        options.listen,
        " can be reached from other machines, and without a certificate all that "
        "is sent can be read and forged there: make one (`calibctl certs init`, `calibctl certs "
        "issue`) and name its folder with --tls, or listen on 127.0.0.1, or say --insecure"));
  }
  if (const absl::Status whole = access::FinishRenewal(options.tls); !whole.ok()) {
    return absl::InvalidArgumentError(whole.message());
  }
  const auto credentials = access::ReadCredentials(options.tls);
  if (!credentials.ok()) {
    return absl::InvalidArgumentError(credentials.status().message());
  }
  if (credentials->holder.role != access::Role::kServer) {
    return absl::InvalidArgumentError(absl::StrCat(
        options.tls, " holds a certificate of the role ", access::NameOf(credentials->holder.role),
        ", and a server wants its own "
        "(`calibctl certs issue CA --role server NAME --host HOST -o DIR`)"));
  }
  const absl::Status own =
      access::CheckOwn(*credentials, std::chrono::duration_cast<std::chrono::seconds>(
                                         std::chrono::system_clock::now().time_since_epoch())
                                         .count());
  return own.ok() ? own : absl::InvalidArgumentError(own.message());
}

}  // namespace

struct Server::Impl {
  std::unique_ptr<StateFolder> folder;
  std::unique_ptr<Core> core;
  std::unique_ptr<CampaignsService> campaigns;
  std::unique_ptr<WorkerLinkService> workers;
  std::unique_ptr<grpc::Server> grpc;
  std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> acceptor;
  std::unique_ptr<Listener> listener;  // goes first: it hands connections to the acceptor
  std::string address;
  std::string inside;  // shown over channels inside this process
  absl::Mutex mutex;
  grpc::HealthCheckServiceInterface* health ABSL_GUARDED_BY(mutex) = nullptr;  // of grpc

  /// Whether it serves, to who asks by grpc.health.v1, of all or of one service. On any thread.
  void Tell(bool serves) {
    const absl::MutexLock lock(&mutex);
    if (health == nullptr) return;
    health->SetServingStatus(serves);
    health->SetServingStatus(v1::Campaigns::service_full_name(), serves);
    health->SetServingStatus(v1::WorkerLink::service_full_name(), serves);
  }
  void TellNoMore() {
    Tell(false);
    const absl::MutexLock lock(&mutex);
    health = nullptr;
  }

  /// token: left for programs of this account before anybody is let in; empty: nobody needs one.
  absl::Status Listen(const std::string& listen, const std::string& tls, const std::string& token,
                      const Limits& limits) {
    const std::int64_t files = RaiseFileLimit();
    const std::int64_t most =
        std::max<std::int64_t>(1, std::min<std::int64_t>(limits.connections, files - kOtherFiles));
    ASSIGN_OR_RETURN(listener, Listener::Open(listen, static_cast<int>(most)));
    // Open to all, as the schema and whether a server serves are: for grpcurl and who balances.
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    grpc::ServerBuilder builder;
    builder.SetResourceQuota(grpc::ResourceQuota("calibd").SetMaxThreads(kReflectionThreads));
    using Type = grpc::ServerBuilder::experimental_type::ExternalConnectionType;
    acceptor =
        builder.experimental().AddExternalConnectionAcceptor(Type::FROM_FD, CredentialsOf(tls));
    builder.RegisterService(campaigns.get());
    builder.RegisterService(workers.get());
    builder.SetMaxReceiveMessageSize(kLargestMessage);
    // More wait on the other side; those that come are refused by the door, in a sentence.
    builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, 2 * limits.streams_per_peer);
    builder.AddChannelArgument(GRPC_ARG_HTTP2_BDP_PROBE, 0);
    builder.AddChannelArgument(GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES, kUnreadBytes);
    builder.AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, kHandshakeMs);
    builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMs);
    builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
    builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
    builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                               kFastestPingMs);
    grpc = builder.BuildAndStart();
    if (grpc == nullptr) {
      return absl::InternalError("gRPC does not start");
    }
    {
      const absl::MutexLock lock(&mutex);
      health = grpc->GetHealthCheckService();
    }
    Tell(true);
    if (!token.empty() && listener->port() != 0) {
      if (const auto left = folder->LeaveToken(token, listener->port()); !left.ok()) {
        spdlog::warn("token_not_left reason=\"{}\"", std::string(left.message()));
      }
    }
    listener->Start([this](int connection) {
      grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters parameters;
      parameters.fd = connection;
      acceptor->HandleNewConnection(&parameters);
    });
    if (listener->port() == 0) {
      address = listen;
    } else {  // all addresses are reached here by that of this machine
      const std::string host = rpc::HostOf(listen);
      address = absl::StrCat(host == "0.0.0.0" ? "127.0.0.1"
                             : host == "[::]"  ? "[::1]"
                                               : host,
                             ":", listener->port());
    }
    return absl::OkStatus();
  }
};

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Server::~Server() { Shutdown(kDefaultShutdown); }

absl::StatusOr<std::unique_ptr<Server>> Server::Start(ServerOptions options) {
  if (options.listen.empty() || !rpc::SocketPathOf(options.listen).empty()) {
    options.tls.clear();  // a socket is its account's: nobody else can listen in
  }
  RETURN_IF_ERROR(CheckReach(options));
  ASSIGN_OR_RETURN(auto folder, StateFolder::Open(options.state_dir));
  RETURN_IF_ERROR(StartLog(options.log_file, options.log));
  ASSIGN_OR_RETURN(const std::string token, folder->Token());
  ASSIGN_OR_RETURN(const std::string inside, access::MakeToken());
  ASSIGN_OR_RETURN(auto guard, Guard::Open(options.tls, token, AccountName(), inside));
  if (options.listen.empty()) {
    ASSIGN_OR_RETURN(options.listen, folder->SocketAddress());
  }
  RemoveHalfBackup(options.state_dir);
  ASSIGN_OR_RETURN(auto store,
                   store::Store::Open(folder->DatabasePath(), std::move(options.store_hooks)));
  auto impl = std::make_unique<Impl>();
  impl->folder = std::move(folder);
  impl->inside = inside;
  impl->core = std::make_unique<Core>(
      std::move(store), std::move(guard),
      scheduler::SchedulerOptions{.lease = options.lease,
                                  .heartbeat = options.heartbeat,
                                  .most_slots = options.limits.slots,
                                  .most_campaigns = options.limits.campaigns},
      options.limits,
      [on_failure = std::move(options.on_failure), self = impl.get()](const absl::Status& status) {
        self->Tell(false);
        if (on_failure) {
          on_failure(status);
        }
      });
  impl->campaigns = std::make_unique<CampaignsService>(
      *impl->core,
      CampaignsService::Site{
          .state_folder = options.state_dir, .listen = options.listen, .tls = options.tls});
  impl->workers = std::make_unique<WorkerLinkService>(*impl->core, options.state_dir);
  std::promise<absl::Status> loaded;
  impl->core->Post([&] { loaded.set_value(impl->core->Start()); });
  RETURN_IF_ERROR(loaded.get_future().get());
  RETURN_IF_ERROR(
      impl->Listen(options.listen, options.tls, options.tls.empty() ? token : "", options.limits));
  // From here on peers may be connected, which only a shutdown parts with in time.
  std::unique_ptr<Server> server(new Server(std::move(impl)));
  RETURN_IF_ERROR(server->impl_->folder->Announce(server->impl_->address, options.stays));
  spdlog::info("serving address={} state={} tls={}", server->impl_->address, options.state_dir,
               options.tls.empty() ? "none" : options.tls);
  return server;
}

int Server::port() const { return impl_->listener->port(); }

std::shared_ptr<grpc::Channel> Server::InProcessChannel() {
  return rpc::OpenChannelInside(*impl_->grpc, impl_->inside);
}

std::string Server::address() const { return impl_->address; }

void Server::Shutdown(std::chrono::milliseconds deadline) {
  if (impl_ == nullptr) {
    return;
  }
  spdlog::info("shutdown address={}", impl_->address);
  impl_->TellNoMore();
  impl_->listener.reset();
  impl_->core->BeginShutdown();
  impl_->grpc->Shutdown(std::chrono::system_clock::now() + deadline);
  impl_->grpc->Wait();
  impl_->grpc.reset();
  impl_->core.reset();
  impl_.reset();
}

}  // namespace calib::service
