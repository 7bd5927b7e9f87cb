#include "server/page/page.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "calib/return_if_error.h"
#include "proto/rpc/address.h"
#include "proto/rpc/random_id.h"
#include "server/page/admission.h"
#include "server/page/answers.h"
#include "server/page/changes.h"
#include "server/page/compact.h"
#include "server/page/target.h"

namespace calib::page {
namespace {

constexpr const char* kJson = "application/json";
constexpr const char* kText = "text/plain; charset=utf-8";
constexpr const char* kMetricsText = "text/plain; version=0.0.4; charset=utf-8";
constexpr const char* kNoAnswer = "the server that the page asks does not answer";
/// Scripts, styles and questions of this page alone; pictures that it has drawn itself.
constexpr const char* kContentPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
constexpr const char* kRetrySeconds = "2";
constexpr std::size_t kInstanceDigits = 8;

std::string TypeOf(std::string_view name) {
  static constexpr std::pair<std::string_view, const char*> kTypes[] = {
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".svg", "image/svg+xml"},
      {".json", kJson},
      {".woff2", "font/woff2"},
  };
  for (const auto& [end, type] : kTypes) {
    if (name.ends_with(end)) return type;
  }
  return "application/octet-stream";
}

/// What every answer says.
HttpAnswer AnswerOf(int status, const std::string& type) {
  HttpAnswer answer{.status = status,
                    .headers = {{"Content-Security-Policy", kContentPolicy},
                                {"X-Content-Type-Options", "nosniff"},
                                {"Referrer-Policy", "no-referrer"},
                                {"Cross-Origin-Resource-Policy", "same-origin"}}};
  if (!type.empty()) answer.headers.emplace_back("Content-Type", type);
  return answer;
}

HttpAnswer Text(int status, const std::string& text) {
  HttpAnswer answer = AnswerOf(status, kText);
  answer.headers.emplace_back("Cache-Control", "no-store");
  answer.body = std::make_shared<const std::string>(text + "\n");
  return answer;
}

HttpAnswer Refusal(int status, const std::string& why, const std::string& command = "") {
  HttpAnswer answer = AnswerOf(status, kJson);
  answer.headers.emplace_back("Cache-Control", "no-store");
  if (status == 503) answer.headers.emplace_back("Retry-After", kRetrySeconds);
  if (status == 401) answer.headers.emplace_back("WWW-Authenticate", "Bearer");
  nlohmann::ordered_json json = {{"error", why}};
  if (!command.empty()) json["command"] = command;
  answer.body = std::make_shared<const std::string>(
      json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
  return answer;
}

HttpAnswer Refusal(const absl::Status& why) {
  const std::string text(why.message());
  switch (why.code()) {
    case absl::StatusCode::kNotFound:
      return Refusal(404, text);
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kOutOfRange:
      return Refusal(400, text);
    case absl::StatusCode::kFailedPrecondition:  // not yet, or never of this campaign
      return Refusal(409, text);
    case absl::StatusCode::kResourceExhausted:
      return Refusal(503, text);
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kDeadlineExceeded:
    case absl::StatusCode::kCancelled:
      return Refusal(503, "the server that is asked does not answer");
    default:
      return Refusal(500, text);
  }
}

/// Whether the peer has this content already.
bool Has(const HttpRequest& request, const std::string& etag) {
  for (const std::string& one :
       std::vector<std::string>(absl::StrSplit(request.if_none_match, ','))) {
    if (absl::EndsWith(absl::StripTrailingAsciiWhitespace(one), etag)) return true;
  }
  return false;
}

HttpAnswer Send(const HttpRequest& request, const Kept& kept, const std::string& type,
                const char* caching) {
  const bool is_there = Has(request, kept.etag);
  HttpAnswer answer = AnswerOf(is_there ? 304 : 200, type);
  answer.headers.emplace_back("Cache-Control", caching);
  answer.headers.emplace_back("ETag", "W/" + kept.etag);
  answer.headers.emplace_back("Vary", "Accept-Encoding");
  if (is_there) return answer;
  if (kept.gzip != nullptr && TakesGzip(request.accept_encoding)) {
    answer.headers.emplace_back("Content-Encoding", "gzip");
    answer.body = kept.gzip;
  } else {
    answer.body = kept.plain;
  }
  return answer;
}

absl::Status CheckReach(const PageOptions& options) {
  if (!options.tls.empty() || options.insecure || rpc::IsLoopback(options.listen)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat(
      options.listen,
      " can be reached from other machines, and without a certificate all that the page shows can "
      "be read there: start calibd with --tls DIR, or serve the page on 127.0.0.1"));
}

}  // namespace

struct Page::Impl {
  std::string listen;
  std::string token;
  bool is_secure = false;
  bool checks_host = false;
  std::unique_ptr<Admission> admission;
  std::map<std::string, Kept> files;
  // Those of the thread of `http`, and what its last connections still speak to.
  Changes changes{rpc::RandomId().substr(0, kInstanceDigits)};
  std::unique_ptr<HttpServer> http;
  std::unique_ptr<Answers> answers;
  std::unique_ptr<ChangesListener> listener;  // goes first

  void Handle(const HttpRequest& request, const HttpServer::Finish& finish);
  HttpAnswer File(const HttpRequest& request, const std::string& name) const;
  void Ask(const HttpRequest& request, const Target& target, const HttpServer::Finish& finish);
  /// A text that the server is asked for and everybody may see.
  void AskOpenly(const HttpRequest& request, Document document,
                 const HttpServer::Finish& finish) const;
  /// Answers what needs no token; empty: it needs one.
  std::optional<HttpAnswer> Open(const Target& target) const;
};

std::optional<HttpAnswer> Page::Impl::Open(const Target& target) const {
  if (target.path == std::vector<std::string>{"healthz"}) return Text(200, "ok");
  if (const auto cookie = admission->CookieFor(target); cookie) {
    HttpAnswer answer = AnswerOf(303, "");
    answer.headers.emplace_back("Set-Cookie", *cookie);
    answer.headers.emplace_back("Location", "/");
    answer.headers.emplace_back("Cache-Control", "no-store");
    return answer;
  }
  return std::nullopt;
}

void Page::Impl::AskOpenly(const HttpRequest& request, Document document,
                           const HttpServer::Finish& finish) const {
  if (!changes.is_up()) {
    finish(Text(503, kNoAnswer));
    return;
  }
  answers->Get({.document = document}, "",
               [request, finish, document](const absl::StatusOr<Kept>& kept) {
                 if (kept.ok()) {
                   finish(Send(request, *kept,
                               document == Document::kMetrics ? kMetricsText : kText, "no-store"));
                 } else if (absl::IsResourceExhausted(kept.status())) {
                   finish(Text(503, std::string(kept.status().message())));
                 } else {
                   finish(Text(503, kNoAnswer));
                 }
               });
}

HttpAnswer Page::Impl::File(const HttpRequest& request, const std::string& name) const {
  const auto file = files.find(name);
  if (file != files.end()) return Send(request, file->second, TypeOf(name), "no-cache");
  if (name == "index.html") {
    return Text(200,
                "This build has no page (CALIB_PAGE=OFF); its documents are under /api/v1/, as "
                "/api/v1/campaigns.");
  }
  return Refusal(404, "there is nothing at this address");
}

void Page::Impl::Ask(const HttpRequest& request, const Target& target,
                     const HttpServer::Finish& finish) {
  if (target.path.size() == 3 && target.path[2] == "events") {
    HttpAnswer answer = AnswerOf(200, "text/event-stream");
    answer.headers.emplace_back("Cache-Control", "no-store");
    answer.feed = changes.NewFeed();
    finish(std::move(answer));
    return;
  }
  const auto question = ParseQuestion(target);
  if (!question.ok()) {
    finish(Refusal(question.status()));
    return;
  }
  answers->Get(*question, changes.StampOf(*question),
               [request, finish, question = *question](const absl::StatusOr<Kept>& kept) {
                 if (kept.ok()) {
                   finish(Send(request, *kept, kJson, "no-store"));
                 } else if (question.document == Document::kGrains &&
                            absl::IsFailedPrecondition(kept.status())) {
                   finish(Refusal(404, std::string(kept.status().message()),
                                  absl::StrCat("calibctl vtk ", question.campaign, " ",
                                               *question.number, " --keep -o grains")));
                 } else {
                   finish(Refusal(kept.status()));
                 }
               });
}

void Page::Impl::Handle(const HttpRequest& request, const HttpServer::Finish& finish) {
  if (checks_host && !IsNameOfThisMachine(HostIn(request.host))) {
    finish(Refusal(403, "this page is for this machine alone: open it as localhost or 127.0.0.1"));
    return;
  }
  const auto target = ParseTarget(request.target);
  if (!target.ok()) {
    finish(Refusal(request.target.size() > kLongestTarget ? 414 : 400,
                   std::string(target.status().message())));
    return;
  }
  if (target->path == std::vector<std::string>{"metrics"}) {
    AskOpenly(request, Document::kMetrics, finish);
    return;
  }
  if (target->path == std::vector<std::string>{"readyz"}) {
    AskOpenly(request, Document::kReady, finish);
    return;
  }
  if (auto open = Open(*target); open) {
    finish(*std::move(open));
    return;
  }
  if (const absl::Status admitted = admission->Admit(request); !admitted.ok()) {
    finish(Refusal(absl::IsUnauthenticated(admitted) ? 401 : 403, std::string(admitted.message())));
    return;
  }
  const auto& path = target->path;
  if (path.empty()) {
    finish(File(request, "index.html"));
  } else if (path.size() == 1) {
    finish(File(request, path[0]));
  } else if (path[0] == "api" && path[1] == "v1") {
    Ask(request, *target, finish);
  } else {
    finish(Refusal(404, "there is nothing at this address"));
  }
}

Page::Page(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

absl::StatusOr<std::unique_ptr<Page>> Page::Start(const PageOptions& options) {
  RETURN_IF_ERROR(CheckReach(options));
  auto impl = std::make_unique<Impl>();
  impl->listen = options.listen;
  impl->token = options.token;
  impl->is_secure = !options.tls.empty();
  impl->checks_host = !impl->is_secure && rpc::IsLoopback(options.listen);
  ASSIGN_OR_RETURN(impl->admission, Admission::Open(options.token, options.tls));
  for (const BundledFile& file : options.files) {
    impl->files.emplace(file.name, MakeKept(std::string(file.content)));
  }
  ASSIGN_OR_RETURN(
      impl->http,
      HttpServer::Open(
          {.listen = options.listen, .tls = options.tls, .limits = options.limits},
          [self = impl.get()](const HttpRequest& request, const HttpServer::Finish& finish) {
            self->Handle(request, finish);
          },
          [](int status, const std::string& why) { return Refusal(status, why); }));
  const auto post = [http = impl->http.get()](std::function<void()> task) {
    http->Post(std::move(task));
  };
  impl->admission->SetPort(impl->http->port());
  impl->answers = std::make_unique<Answers>(options.connect, post);
  impl->listener = std::make_unique<ChangesListener>(options.connect, impl->changes, post);
  impl->http->Begin();
  return std::unique_ptr<Page>(new Page(std::move(impl)));
}

Page::~Page() { impl_->http->Stop(); }

int Page::port() const { return impl_->http->port(); }

std::string Page::address() const {
  const std::string host = rpc::HostOf(impl_->listen);
  return absl::StrCat(impl_->is_secure ? "https://" : "http://",
                      host == "0.0.0.0" ? "127.0.0.1"
                      : host == "[::]"  ? "[::1]"
                                        : host,
                      ":", port(), "/");
}

const std::string& Page::token() const { return impl_->token; }

}  // namespace calib::page
