#include "tests/support/proxy.h"

#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <deque>
#include <thread>
#include <utility>
#include <vector>

namespace calib::testing {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using Clock = std::chrono::steady_clock;
using Failure = boost::system::error_code;

/// What all connections are subject to.
struct Condition {
  std::chrono::milliseconds delay{0};
  bool silent = false;
};

/// One connection through the proxy: two directions, each a queue of what has come in.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(tcp::socket near, asio::io_context& context, const Condition& condition)
      : near_(std::move(near)),
        far_(context),
        condition_(condition),
        directions_{Direction(near_, far_, context), Direction(far_, near_, context)} {}

  void Begin(const tcp::endpoint& target) {
    far_.async_connect(target, [self = shared_from_this()](const Failure& failure) {
      if (failure) return self->End();
      Failure ignored;
      self->near_.set_option(tcp::no_delay(true), ignored);
      self->far_.set_option(tcp::no_delay(true), ignored);
      for (Direction& direction : self->directions_) self->Read(direction);
    });
  }
  void HandOnBoth() {
    for (Direction& direction : directions_) HandOn(direction);
  }
  void End() {
    Failure ignored;
    near_.close(ignored);
    far_.close(ignored);
    for (Direction& direction : directions_) direction.due.cancel();
  }

 private:
  struct Piece {
    Clock::time_point due;
    std::string bytes;  // empty: the end
  };
  struct Direction {
    Direction(tcp::socket& source, tcp::socket& sink, asio::io_context& context)
        : from(source), to(sink), due(context) {}
    tcp::socket& from;
    tcp::socket& to;
    asio::steady_timer due;
    std::deque<Piece> held{};
    std::array<char, 1 << 16> buffer{};
    bool writes = false;
  };

  void Read(Direction& direction) {
    direction.from.async_read_some(
        asio::buffer(direction.buffer),
        [this, self = shared_from_this(), &direction](const Failure& failure, std::size_t count) {
          direction.held.push_back(
              {Clock::now() + condition_.delay, std::string(direction.buffer.data(), count)});
          HandOn(direction);
          if (!failure) Read(direction);
        });
  }

  void HandOn(Direction& direction) {
    if (direction.writes || direction.held.empty() || condition_.silent) return;
    const Piece& next = direction.held.front();
    if (next.due > Clock::now()) {
      direction.due.expires_at(next.due);
      direction.due.async_wait(
          [this, self = shared_from_this(), &direction](const Failure& failure) {
            if (!failure) HandOn(direction);
          });
      return;
    }
    if (next.bytes.empty()) return End();
    direction.writes = true;
    asio::async_write(
        direction.to, asio::buffer(next.bytes),
        [this, self = shared_from_this(), &direction](const Failure& failure, std::size_t) {
          direction.writes = false;
          if (failure) return End();
          direction.held.pop_front();
          HandOn(direction);
        });
  }

  tcp::socket near_, far_;
  const Condition& condition_;
  std::array<Direction, 2> directions_;
};

tcp::endpoint EndpointOf(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  return {asio::ip::make_address(address.substr(0, colon)),
          static_cast<std::uint16_t>(std::stoi(address.substr(colon + 1)))};
}

}  // namespace

class Proxy::Switch {
 public:
  explicit Switch(const std::string& target)
      : target_(EndpointOf(target)),
        acceptor_(context_, tcp::endpoint(asio::ip::address_v4::loopback(), 0)) {
    Accept();
    thread_ = std::jthread([this] { context_.run(); });
  }
  ~Switch() { context_.stop(); }

  int port() const { return acceptor_.local_endpoint().port(); }

  /// In the thread of the connections.
  template <typename Change>
  void Do(Change change) {
    asio::post(context_, [this, change = std::move(change)] { change(*this); });
  }
  template <typename Change>
  void OnEach(Change change) {
    for (const auto& connection : connections_) {
      if (const auto held = connection.lock()) change(*held);
    }
    std::erase_if(connections_, [](const auto& connection) { return connection.expired(); });
  }
  Condition& condition() { return condition_; }

 private:
  void Accept() {
    acceptor_.async_accept([this](const Failure& failure, tcp::socket socket) {
      if (failure) return;
      const auto connection = std::make_shared<Connection>(std::move(socket), context_, condition_);
      connections_.push_back(connection);
      connection->Begin(target_);
      Accept();
    });
  }

  const tcp::endpoint target_;
  asio::io_context context_;
  tcp::acceptor acceptor_;
  Condition condition_;
  std::vector<std::weak_ptr<Connection>> connections_;
  std::jthread thread_;  // the last, so that it ends first
};

Proxy::Proxy(const std::string& target)
    : switch_(std::make_unique<Switch>(target)),
      address_("127.0.0.1:" + std::to_string(switch_->port())) {}

Proxy::~Proxy() = default;

void Proxy::Cut() {
  switch_->Do([](Switch& all) { all.OnEach([](Connection& connection) { connection.End(); }); });
}

void Proxy::SetDelay(std::chrono::milliseconds delay) {
  switch_->Do([delay](Switch& all) { all.condition().delay = delay; });
}

void Proxy::SetSilent(bool silent) {
  switch_->Do([silent](Switch& all) {
    all.condition().silent = silent;
    all.OnEach([](Connection& connection) { connection.HandOnBoth(); });
  });
}

}  // namespace calib::testing
