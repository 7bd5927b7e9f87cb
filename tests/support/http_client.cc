#include "tests/support/http_client.h"

#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

namespace calib::testing {
namespace {

std::string Lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace

HttpConnection::HttpConnection(int port) : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  if (connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    close(std::exchange(socket_, -1));
  }
}

HttpConnection::~HttpConnection() {
  if (socket_ >= 0) close(socket_);
}

HttpConnection::HttpConnection(HttpConnection&& other) noexcept
    : socket_(std::exchange(other.socket_, -1)), received_(std::move(other.received_)) {}

bool HttpConnection::Send(const std::string& bytes) const {
  return send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL) ==
         static_cast<ssize_t>(bytes.size());
}

bool HttpConnection::Read(std::chrono::steady_clock::time_point until) {
  const auto left =  // rounded up, so that a wait ends after its time
      std::chrono::ceil<std::chrono::milliseconds>(until - std::chrono::steady_clock::now());
  pollfd wait{.fd = socket_, .events = POLLIN, .revents = 0};
  if (left.count() <= 0 || poll(&wait, 1, static_cast<int>(left.count())) <= 0) return false;
  std::array<char, 65536> bytes{};
  const ssize_t count = recv(socket_, bytes.data(), bytes.size(), 0);
  if (count <= 0) return false;
  received_.append(bytes.data(), static_cast<std::size_t>(count));
  return true;
}

std::string HttpConnection::Receive(std::chrono::milliseconds limit) {
  const auto until = std::chrono::steady_clock::now() + limit;
  while (Read(until)) {
  }
  return received_;
}

bool HttpConnection::ReceiveUntil(const std::string& text, std::chrono::milliseconds limit) {
  const auto until = std::chrono::steady_clock::now() + limit;
  while (received_.find(text) == std::string::npos) {
    if (!Read(until)) return false;
  }
  return true;
}

bool HttpConnection::IsClosed(std::chrono::milliseconds limit) {
  const auto until = std::chrono::steady_clock::now() + limit;
  while (Read(until)) {
  }
  return socket_ < 0 || std::chrono::steady_clock::now() < until;
}

HttpReply HttpConnection::Reply(bool is_head, std::chrono::milliseconds limit) {
  HttpReply reply;
  if (!ReceiveUntil("\r\n\r\n", limit)) return reply;
  const std::size_t end = received_.find("\r\n\r\n");
  const std::string head = received_.substr(0, end + 2);
  received_.erase(0, end + 4);
  reply.status = std::stoi(head.substr(head.find(' ') + 1));
  for (std::size_t at = head.find("\r\n") + 2; at < head.size();) {
    const std::size_t line_end = head.find("\r\n", at);
    const std::string line = head.substr(at, line_end - at);
    const std::size_t colon = line.find(':');
    reply.headers[Lower(line.substr(0, colon))] = line.substr(std::min(colon + 2, line.size()));
    at = line_end + 2;
  }
  const auto length = reply.headers.find("content-length");
  if (is_head || length == reply.headers.end()) return reply;
  const auto bytes = static_cast<std::size_t>(std::stoul(length->second));
  const auto until = std::chrono::steady_clock::now() + limit;
  while (received_.size() < bytes && Read(until)) {
  }
  reply.body = received_.substr(0, bytes);
  received_.erase(0, bytes);
  return reply;
}

HttpReply Fetch(int port, const std::string& target, const std::vector<std::string>& headers,
                const std::string& method) {
  HttpConnection connection(port);
  std::string request = method + " " + target + " HTTP/1.1\r\n";
  bool has_host = false;
  for (const std::string& line : headers) {
    request += line + "\r\n";
    has_host = has_host || Lower(line).starts_with("host:");
  }
  if (!has_host) request += "Host: 127.0.0.1:" + std::to_string(port) + "\r\n";
  if (!connection.Send(request + "\r\n")) return {};
  return connection.Reply(method == "HEAD");
}

}  // namespace calib::testing
