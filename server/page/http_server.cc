#include "server/page/http_server.h"

#include <openssl/ssl.h>

#include <algorithm>
#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/v6_only.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>
#include <ctime>
#include <optional>
#include <set>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "proto/rpc/address.h"
#include "server/access/x509.h"
#include "server/page/tls_context.h"

namespace calib::page {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using tcp = asio::ip::tcp;
using Clock = std::chrono::steady_clock;
using Error = boost::system::error_code;

constexpr int kIdleRequests = 6;  // a connection that has been of use is kept so many times longer
constexpr std::size_t kMebibyte = 1 << 20;
constexpr std::size_t kMostUnread = 1 << 16;  // of a request that was refused, until it is left
constexpr std::chrono::seconds kLinger{1};
constexpr std::chrono::milliseconds kAcceptAgain{100};

std::string HttpDate() {
  constexpr std::size_t kLongest = 40;
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::array<char, kLongest> text{};
  const std::size_t size =
      std::strftime(text.data(), text.size(), "%a, %d %b %Y %H:%M:%S GMT", &utc);
  return {text.data(), size};
}

/// The lines before a body.
std::string HeadOf(const HttpAnswer& answer, bool keeps_alive) {
  std::string head =
      absl::StrCat("HTTP/1.1 ", answer.status, " ",
                   std::string(http::obsolete_reason(static_cast<http::status>(answer.status))),
                   "\r\nDate: ", HttpDate(), "\r\n");
  for (const auto& [name, value] : answer.headers)
    absl::StrAppend(&head, name, ": ", value, "\r\n");
  if (answer.feed == nullptr && answer.status != 304) {
    absl::StrAppend(&head, "Content-Length: ", answer.body ? answer.body->size() : 0, "\r\n");
  }
  absl::StrAppend(&head, "Connection: ", keeps_alive ? "keep-alive" : "close", "\r\n\r\n");
  return head;
}

/// A connection as the server sees it.
class Peer {
 public:
  virtual ~Peer() = default;
  virtual void Close() = 0;

  bool is_idle = true;  ///< no request of it is being answered
  Clock::time_point since = Clock::now();
};

}  // namespace

struct HttpServer::Impl {
  explicit Impl(const HttpOptions& options) : limits(options.limits) {}

  absl::Status Listen(const HttpOptions& options);
  void Accept(tcp::acceptor& acceptor);
  void Take(tcp::socket socket);
  void MakeRoom();

  const HttpLimits limits;
  Handler handler;
  std::function<HttpAnswer(int, const std::string&)> refuse;
  std::unique_ptr<TlsContext> tls;
  // The thread's. Before `io`, with which the last connections go.
  std::set<Peer*> peers;  // those that are open
  std::size_t feeds = 0;
  bool stopped = false;
  asio::io_context io{1};
  std::vector<tcp::acceptor> acceptors;
  asio::steady_timer again{io};
  std::thread thread;
};

namespace {

using Plain = beast::tcp_stream;
using Tls = beast::ssl_stream<beast::tcp_stream>;

/// Reads a request, has it answered, writes the answer, and so on. Every step holds it alive.
template <typename Stream>
class Connection final : public Peer, public std::enable_shared_from_this<Connection<Stream>> {
 public:
  template <typename... Context>
  Connection(HttpServer::Impl& server, tcp::socket socket, Context&... context)
      : server_(server),
        stream_(std::move(socket), context...),
        buffer_(2 * server.limits.header_bytes),
        timer_(server.io) {
    server_.peers.insert(this);
  }
  ~Connection() override {
    server_.peers.erase(this);
    if (feed_ != nullptr) --server_.feeds;
  }

  void Begin() {
    if constexpr (std::is_same_v<Stream, Tls>) {
      Lowest().expires_after(server_.limits.request);
      stream_.async_handshake(asio::ssl::stream_base::server,
                              [self = this->shared_from_this()](const Error& error) {
                                if (!error) self->Greeted();
                              });
    } else {
      Read(server_.limits.request);
    }
  }

  void Close() override {
    server_.peers.erase(this);
    Error ignored;
    timer_.cancel();
    Lowest().socket().shutdown(tcp::socket::shutdown_both, ignored);
    Lowest().close();
    if (feed_ != nullptr) feed_->wake = [] {};
  }

 private:
  beast::tcp_stream& Lowest() { return beast::get_lowest_layer(stream_); }

  void Greeted() {
    if constexpr (std::is_same_v<Stream, Tls>) {
      const access::X509Ptr shown(SSL_get1_peer_certificate(stream_.native_handle()));
      if (shown != nullptr) certificate_ = access::PemOf(shown.get()).value_or("");
    }
    Read(server_.limits.request);
  }

  void Read(std::chrono::seconds within) {
    is_idle = true;
    since = Clock::now();
    parser_.emplace();
    parser_->header_limit(static_cast<std::uint32_t>(server_.limits.header_bytes));
    Lowest().expires_after(within);
    http::async_read_header(stream_, buffer_, *parser_,
                            [self = this->shared_from_this()](const Error& error, std::size_t) {
                              self->Received(error);
                            });
  }

  void Received(const Error& error) {
    if (error && error.category() == http::make_error_code(http::error::bad_method).category() &&
        error != http::error::end_of_stream && error != http::error::partial_message) {
      const bool is_long =
          error == http::error::header_limit || error == http::error::buffer_overflow;
      Refuse(is_long ? 431 : 400,
             is_long ? "the request is too long" : "this is no request as HTTP/1.1 has it");
      return;
    }
    if (error) return;  // gone, or too slow
    is_idle = false;
    const auto& message = parser_->get();
    const bool has_body = parser_->content_length().value_or(0) > 0 || parser_->chunked();
    is_head_ = message.method() == http::verb::head;
    if (message.method() != http::verb::get && !is_head_) {
      HttpAnswer answer = server_.refuse(405, "this page only reads: GET and HEAD");
      answer.headers.emplace_back("Allow", "GET, HEAD");
      Write(std::move(answer), false);
      return;
    }
    if (has_body) {
      Refuse(400, "a question has no body");
      return;
    }
    keeps_alive_ = message.keep_alive();
    const auto header = [&message](http::field name) {
      const auto value = message[name];
      return std::string(value.data(), value.size());
    };
    server_.handler({.method = is_head_ ? "HEAD" : "GET",
                     .target = std::string(message.target()),
                     .host = header(http::field::host),
                     .authorization = header(http::field::authorization),
                     .cookie = header(http::field::cookie),
                     .accept_encoding = header(http::field::accept_encoding),
                     .if_none_match = header(http::field::if_none_match),
                     .certificate = certificate_},
                    [self = this->shared_from_this()](HttpAnswer answer) {
                      if (!self->Lowest().socket().is_open()) return;
                      self->Write(std::move(answer), self->keeps_alive_);
                    });
  }

  void Refuse(int status, const std::string& why) {
    is_idle = false;
    Write(server_.refuse(status, why), false);
  }

  void Write(HttpAnswer answer, bool keeps_alive) {
    if (answer.feed != nullptr && server_.feeds >= server_.limits.feeds) {
      answer = server_.refuse(503, "as many live views as this page serves are open");
    }
    if (answer.feed != nullptr && !is_head_) {
      feed_ = std::move(answer.feed);
      ++server_.feeds;
      answer.feed = feed_;
      keeps_alive = false;
    }
    head_ = HeadOf(answer, keeps_alive);
    body_ = is_head_ || answer.body == nullptr ? std::make_shared<const std::string>()
                                               : std::move(answer.body);
    Lowest().expires_after(server_.limits.write * (1 + body_->size() / kMebibyte));
    asio::async_write(
        stream_, std::array<asio::const_buffer, 2>{asio::buffer(head_), asio::buffer(*body_)},
        [self = this->shared_from_this(), keeps_alive](const Error& error, std::size_t) {
          if (error) {
            self->Close();
          } else if (self->feed_ != nullptr) {
            self->BeginFeed();
          } else if (keeps_alive) {
            self->Read(kIdleRequests * self->server_.limits.request);
          } else {
            self->Linger();
          }
        });
  }

  /// What the peer still sends is taken for a while: a close with something unread would take the
  /// answer from it.
  void Linger() {
    Error ignored;
    Lowest().socket().shutdown(tcp::socket::shutdown_send, ignored);
    Lowest().expires_after(kLinger);
    Discard(0);
  }

  void Discard(std::size_t before) {
    buffer_.clear();
    Lowest().async_read_some(
        buffer_.prepare(buffer_.max_size()),
        [self = this->shared_from_this(), before](const Error& error, std::size_t bytes) {
          if (error || before + bytes > kMostUnread) {
            self->Close();
          } else {
            self->Discard(before + bytes);
          }
        });
  }

  void BeginFeed() {
    feed_->wake = [weak = this->weak_from_this()] {
      if (auto self = weak.lock(); self != nullptr) self->timer_.cancel();
    };
    // A peer has nothing to say here: what it sends, or its end, ends the feed.
    Lowest().expires_never();
    stream_.async_read_some(
        asio::buffer(scratch_),
        [self = this->shared_from_this()](const Error&, std::size_t) { self->Close(); });
    Pump();
  }

  void Pump() {
    if (!Lowest().socket().is_open()) return;
    piece_ = feed_->Take();
    if (piece_.empty()) {
      timer_.expires_after(server_.limits.heartbeat);
      timer_.async_wait([self = this->shared_from_this()](const Error& error) {
        if (!self->Lowest().socket().is_open()) return;
        if (error) {  // woken
          self->Pump();
        } else {
          self->piece_ = ": nothing new\n\n";
          self->WritePiece();
        }
      });
    } else {
      WritePiece();
    }
  }

  void WritePiece() {
    Lowest().expires_after(server_.limits.write);  // of what is written: a read is under way
    asio::async_write(stream_, asio::buffer(piece_),
                      [self = this->shared_from_this()](const Error& error, std::size_t) {
                        if (error) {
                          self->Close();
                        } else {
                          self->Pump();
                        }
                      });
  }

  HttpServer::Impl& server_;
  Stream stream_;
  beast::flat_buffer buffer_;
  std::array<char, 1> scratch_{};
  asio::steady_timer timer_;
  std::optional<http::request_parser<http::empty_body>> parser_;
  std::string certificate_;
  bool is_head_ = false;
  bool keeps_alive_ = false;
  std::string head_;
  std::shared_ptr<const std::string> body_;
  std::shared_ptr<Feed> feed_;
  std::string piece_;
};

}  // namespace

absl::Status HttpServer::Impl::Listen(const HttpOptions& options) {
  if (!options.tls.empty()) {
    ASSIGN_OR_RETURN(tls, TlsContext::Open(options.tls));
  }
  const auto fail = [&options](const Error& error) {
    return absl::UnavailableError(
        absl::StrCat("cannot listen on ", options.listen, ": ", error.message()));
  };
  std::string host = rpc::HostOf(options.listen);
  if (host.starts_with('[')) host = host.substr(1, host.size() - 2);
  Error error;
  tcp::resolver resolver(io);
  const auto found = resolver.resolve(host, std::to_string(rpc::PortOf(options.listen)),
                                      tcp::resolver::passive, error);
  if (error) return fail(error);
  std::set<tcp::endpoint> places;
  for (const auto& entry : found) places.insert(entry.endpoint());
  for (tcp::endpoint place : places) {
    if (place.port() == 0 && !acceptors.empty()) {
      place.port(acceptors.front().local_endpoint().port());
    }
    tcp::acceptor& acceptor = acceptors.emplace_back(io);
    acceptor.open(place.protocol(), error);
    if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
    if (!error && place.protocol() == tcp::v6()) {
      acceptor.set_option(asio::ip::v6_only(true), error);
    }
    if (!error) acceptor.bind(place, error);
    if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
    if (error) return fail(error);
  }
  return absl::OkStatus();
}

void HttpServer::Impl::Accept(tcp::acceptor& acceptor) {
  acceptor.async_accept([this, &acceptor](const Error& error, tcp::socket socket) {
    if (stopped) return;
    if (!error) {
      Take(std::move(socket));
      Accept(acceptor);
      return;
    }
    // As when no file can be opened, which passes.
    MakeRoom();
    again.expires_after(kAcceptAgain);
    again.async_wait([this, &acceptor](const Error&) {
      if (!stopped) Accept(acceptor);
    });
  });
}

void HttpServer::Impl::Take(tcp::socket socket) {
  if (peers.size() >= limits.connections) MakeRoom();
  if (peers.size() >= limits.connections) return;  // all of them are being answered
  Error ignored;
  socket.set_option(tcp::no_delay(true), ignored);
  if (tls != nullptr) {
    std::make_shared<Connection<Tls>>(*this, std::move(socket), *tls->Current())->Begin();
  } else {
    std::make_shared<Connection<Plain>>(*this, std::move(socket))->Begin();
  }
}

void HttpServer::Impl::MakeRoom() {
  Peer* longest = nullptr;
  for (Peer* peer : peers) {
    if (peer->is_idle && (longest == nullptr || peer->since < longest->since)) longest = peer;
  }
  if (longest != nullptr) longest->Close();
}

HttpServer::HttpServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

HttpServer::~HttpServer() { Stop(); }

absl::StatusOr<std::unique_ptr<HttpServer>> HttpServer::Open(
    const HttpOptions& options, Handler handler,
    std::function<HttpAnswer(int, const std::string&)> refuse) {
  auto impl = std::make_unique<Impl>(options);
  impl->handler = std::move(handler);
  impl->refuse = std::move(refuse);
  RETURN_IF_ERROR(impl->Listen(options));
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(impl)));
}

void HttpServer::Begin() {
  for (tcp::acceptor& acceptor : impl_->acceptors) impl_->Accept(acceptor);
  impl_->thread = std::thread([impl = impl_.get()] { impl->io.run(); });
}

int HttpServer::port() const { return impl_->acceptors.front().local_endpoint().port(); }

void HttpServer::Post(std::function<void()> task) { asio::post(impl_->io, std::move(task)); }

void HttpServer::Stop() {
  if (!impl_->thread.joinable()) return;
  Post([impl = impl_.get()] {
    impl->stopped = true;
    for (tcp::acceptor& acceptor : impl->acceptors) acceptor.close();
    impl->again.cancel();
    for (Peer* peer : std::vector<Peer*>(impl->peers.begin(), impl->peers.end())) peer->Close();
    impl->io.stop();
  });
  impl_->thread.join();
}

}  // namespace calib::page
