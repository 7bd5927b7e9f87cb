#include "proto/rpc/client_options.h"

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <grpcpp/server.h>
#include <grpcpp/support/channel_arguments.h>
#include <grpcpp/support/client_interceptor.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "proto/rpc/address.h"
#include "proto/rpc/server_certificate.h"

namespace calib::rpc {
namespace {

/// Between looks at the files of a certificate [s].
constexpr unsigned kFilesAgain = 1;
constexpr std::chrono::milliseconds kHandshake{1500};
/// For the first byte at a socket that is open. chosen: a server that shares its cores starts so
/// late
constexpr std::chrono::duration<int, std::milli> kFirstWord{10'000};

/// Adds the token to every call that begins, while it is shown to whom it is meant for.
class ShowToken final : public grpc::experimental::Interceptor {
 public:
  ShowToken(std::string value, int own_port) : value_(std::move(value)), own_port_(own_port) {}

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(
            grpc::experimental::InterceptionHookPoints::PRE_SEND_INITIAL_METADATA) &&
        (own_port_ == 0 || !AnotherAccountListens(own_port_))) {
      methods->GetSendInitialMetadata()->insert({"authorization", value_});
    }
    methods->Proceed();
  }

 private:
  const std::string value_;
  const int own_port_;
};

class ShowTokenFactory final : public grpc::experimental::ClientInterceptorFactoryInterface {
 public:
  explicit ShowTokenFactory(const Access& access)
      : value_("Bearer " + access.token), own_port_(access.own_port) {}
  grpc::experimental::Interceptor* CreateClientInterceptor(
      grpc::experimental::ClientRpcInfo* /*info*/) override {
    return new ShowToken(value_, own_port_);  // gRPC's to delete
  }

 private:
  const std::string value_;
  const int own_port_;
};

std::shared_ptr<grpc::ChannelCredentials> CredentialsOf(const Access& access) {
  if (access.tls.empty()) {
    return grpc::InsecureChannelCredentials();
  }
  grpc::experimental::TlsChannelCredentialsOptions options;
  options.set_certificate_provider(
      std::make_shared<grpc::experimental::FileWatcherCertificateProvider>(
          access.tls + "/key.pem", access.tls + "/cert.pem", access.tls + "/ca.pem", kFilesAgain));
  options.watch_root_certs();
  options.watch_identity_key_cert_pairs();
  options.set_certificate_verifier(MakeServerVerifier(access.tls));
  return grpc::experimental::TlsCredentials(options);
}

absl::Status WhyNoSocket(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path.c_str(), std::min(path.size() + 1, sizeof(address.sun_path)));
  const int file = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const std::unique_ptr<const int, void (*)(const int*)> closed(&file,
                                                                [](const int* f) { close(*f); });
  if (connect(file, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    if (errno == EACCES || errno == EPERM) {
      return absl::PermissionDeniedError(
          absl::StrCat("unix:", path, " is the socket of a server of another account"));
    }
    return absl::UnavailableError(absl::StrCat("no server answers at unix:", path));
  }
  ucred listener{};
  socklen_t length = sizeof(listener);
  if (getsockopt(file, SOL_SOCKET, SO_PEERCRED, &listener, &length) == 0 &&
      listener.uid != geteuid() && listener.uid != 0) {
    return absl::PermissionDeniedError(
        absl::StrCat("unix:", path, " is the socket of a server of another account"));
  }
  // A server speaks first (HTTP/2 settings); one that has no room or is not ours closes.
  pollfd answer{.fd = file, .events = POLLIN, .revents = 0};
  if (poll(&answer, 1, kFirstWord.count()) <= 0) {
    return absl::DeadlineExceededError(absl::StrCat(
        "unix:", path, " is open in process ", listener.pid, ", which does not answer within ",
        kFirstWord.count() / 1000, " s: it is busy, or no server of calib"));
  }
  char first = 0;
  if (recv(file, &first, 1, 0) <= 0) {
    return absl::FailedPreconditionError(
        absl::StrCat("unix:", path,
                     " takes the connection and closes it: it has no room for one more "
                     "(calibd --max-connections), or is of another account or no server of calib"));
  }
  return absl::OkStatus();
}

/// Whether anything takes a TCP connection at the address.
bool SomethingListens(const std::string& address) {
  std::string host = HostOf(address);
  if (host.starts_with('[')) host = host.substr(1, host.size() - 2);
  addrinfo wanted{};
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(host.c_str(), std::to_string(PortOf(address)).c_str(), &wanted, &found) != 0) {
    return false;
  }
  bool listens = false;
  for (const addrinfo* one = found; one != nullptr && !listens; one = one->ai_next) {
    const int file = socket(one->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const timeval longest{.tv_sec = 1, .tv_usec = 0};
    setsockopt(file, SOL_SOCKET, SO_SNDTIMEO, &longest, sizeof(longest));
    listens = connect(file, one->ai_addr, one->ai_addrlen) == 0;
    close(file);
  }
  freeaddrinfo(found);
  return listens;
}

/// What gRPC says of a call that finds no connection; empty: there is one by now.
std::string HandshakeError(const std::string& address, const Access& access) {
  const auto channel = OpenChannel(address, access);
  grpc::GenericStub stub(channel);
  grpc::ClientContext context;
  SetDeadline(context, kHandshake);
  grpc::CompletionQueue queue;
  grpc::ByteBuffer reply;
  grpc::Status status;
  const auto call = stub.PrepareUnaryCall(&context, "/calib.v1.Campaigns/List", {}, &queue);
  call->StartCall();
  call->Finish(&reply, &status, nullptr);
  void* tag = nullptr;
  bool ok = false;
  queue.Next(&tag, &ok);
  queue.Shutdown();
  return channel->GetState(false) == GRPC_CHANNEL_READY ? "" : status.error_message();
}

}  // namespace

std::shared_ptr<grpc::Channel> OpenChannel(const std::string& address, const Access& access) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 1000);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 20'000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10'000);
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  // A proxy from the environment must not come between programs on one machine.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  std::vector<std::unique_ptr<grpc::experimental::ClientInterceptorFactoryInterface>> factories;
  if (!access.token.empty()) {
    factories.push_back(std::make_unique<ShowTokenFactory>(access));
  }
  return grpc::experimental::CreateCustomChannelWithInterceptors(address, CredentialsOf(access),
                                                                 arguments, std::move(factories));
}

std::shared_ptr<grpc::Channel> OpenChannelInside(grpc::Server& server, const std::string& token) {
  std::vector<std::unique_ptr<grpc::experimental::ClientInterceptorFactoryInterface>> factories;
  factories.push_back(std::make_unique<ShowTokenFactory>(Access{.token = token}));
  return server.experimental().InProcessChannelWithInterceptors({}, std::move(factories));
}

absl::Status WhyNotConnected(const std::string& address, const Access& access) {
  if (const std::string path = SocketPathOf(address); !path.empty()) {
    return WhyNoSocket(path);
  }
  if (!SomethingListens(address)) {
    return absl::UnavailableError(absl::StrCat("no server answers at ", address));
  }
  const std::string error = HandshakeError(address, access);
  if (error.empty()) {
    return absl::UnavailableError(absl::StrCat("no server answered at ", address));
  }
  // OpenSSL writes "certificate verify failed", BoringSSL "CERTIFICATE_VERIFY_FAILED".
  const std::string plain = absl::StrReplaceAll(absl::AsciiStrToLower(error), {{"_", " "}});
  const auto refused = [&](auto... words) {
    return absl::FailedPreconditionError(absl::StrCat(address, " ", words...));
  };
  if (access.tls.empty()) {
    return refused(
        "takes connections, and does not answer as calibd does in plain text: one with "
        "certificates wants one of its authority (--tls DIR, from `calibctl certs "
        "issue`)");
  }
  if (absl::StrContains(plain, "wrong version number")) {
    return refused(
        "speaks plain text, and --tls asks for a server with a certificate: start "
        "calibd with --tls DIR, or leave --tls (and $CALIB_TLS) out");
  }
  if (absl::StrContains(plain, "verify failed")) {
    return refused("shows a certificate that was not issued by the authority of ", access.tls,
                   "/ca.pem, that has ended, or that is none of a server");
  }
  if (absl::StrContains(error, kRevoked)) {
    return refused("shows a certificate that ", access.tls,
                   "/crl.pem revokes: calibd needs another, and whoever answers with this one may "
                   "be somebody else");
  }
  if (absl::StrContains(plain, "hostname") || absl::StrContains(plain, "peer name")) {
    return refused("shows a certificate that is not for ", HostOf(address),
                   ": issue the server's with --host ", HostOf(address));
  }
  return refused("answers, and no connection comes about: ", error);
}

void SetDeadline(grpc::ClientContext& context, std::chrono::milliseconds from_now) {
  context.set_deadline(std::chrono::system_clock::now() + from_now);
}

}  // namespace calib::rpc
