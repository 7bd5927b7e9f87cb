#include "server/service/upkeep/log.h"

#include <fcntl.h>
#include <spdlog/formatter.h>
#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/sinks/rotating_file_sink.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace calib::service {
namespace {

bool IsWord(std::string_view text) {
  for (const char c : text) {
    if (!absl::ascii_isalnum(static_cast<unsigned char>(c)) && c != '_') return false;
  }
  return !text.empty();
}

/// Where a value in quotes ends that begins at `from`: its texts may hold quotes themselves, so
/// that only one before the end or before the next key counts.
std::size_t EndOfQuoted(std::string_view text, std::size_t from) {
  for (std::size_t at = text.find('"', from); at != std::string_view::npos;
       at = text.find('"', at + 1)) {
    const std::string_view rest = text.substr(at + 1);
    if (rest.empty()) return at;
    if (rest[0] == ' ' && IsWord(rest.substr(1, rest.find('=') - 1))) return at;
  }
  return std::string_view::npos;
}

/// Takes ` key=value` from the front of the text; false: that is not what stands there.
bool TakeField(std::string_view& text, nlohmann::ordered_json& json) {
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos || text[0] != ' ' || !IsWord(text.substr(1, equals - 1))) {
    return false;
  }
  const bool is_quoted = text.substr(equals + 1, 1) == "\"";
  const std::size_t begin = equals + (is_quoted ? 2 : 1);
  const std::size_t found = is_quoted ? EndOfQuoted(text, begin) : text.find(' ', begin);
  if (is_quoted && found == std::string_view::npos) return false;
  const std::size_t end = std::min(found, text.size());
  json[std::string(text.substr(1, equals - 1))] = std::string(text.substr(begin, end - begin));
  text.remove_prefix(is_quoted ? end + 1 : end);
  return true;
}

std::string InUtc(std::chrono::system_clock::time_point when) {
  const auto ms =
      std::chrono::duration_cast<std::chrono::milliseconds>(when.time_since_epoch()).count();
  const std::time_t seconds = ms / 1000;
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  return absl::StrFormat("%04d-%02d-%02dT%02d:%02d:%02d.%03dZ", utc.tm_year + 1900, utc.tm_mon + 1,
                         utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec, ms % 1000);
}

class JsonFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& to) override {
    const auto level = spdlog::level::to_string_view(message.level);
    nlohmann::ordered_json json = {{"time", InUtc(message.time)},
                                   {"level", std::string(level.data(), level.size())}};
    std::string_view text(message.payload.data(), message.payload.size());
    if (const std::string_view event = text.substr(0, text.find(' ')); IsWord(event)) {
      nlohmann::ordered_json fields = nlohmann::ordered_json::object();
      std::string_view rest = text.substr(event.size());
      while (!rest.empty() && TakeField(rest, fields)) {
      }
      if (rest.empty()) {
        json["event"] = std::string(event);
        json.update(fields);
        text = {};
      }
    }
    if (!text.empty()) json["message"] = std::string(text);
    const std::string line =
        json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
    to.append(line.data(), line.data() + line.size());
  }
  std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<JsonFormatter>();
  }
};

spdlog::sink_ptr SinkOf(const std::string& file, const LogForm& form) {
  if (file.empty()) return std::make_shared<spdlog::sinks::stderr_sink_mt>();
  spdlog::file_event_handlers handlers;
  handlers.after_open = [](const spdlog::filename_t&, std::FILE* opened) {
    fchmod(fileno(opened), S_IRUSR | S_IWUSR);
  };
  if (form.file_mib == 0) {
    return std::make_shared<spdlog::sinks::basic_file_sink_mt>(file, false, handlers);
  }
  return std::make_shared<spdlog::sinks::rotating_file_sink_mt>(
      file, static_cast<std::size_t>(form.file_mib) << 20, static_cast<std::size_t>(form.files),
      false, handlers);
}

}  // namespace

std::unique_ptr<spdlog::formatter> MakeJsonFormatter() { return std::make_unique<JsonFormatter>(); }

absl::Status StartLog(const std::string& file, const LogForm& form) {
  if (!file.empty()) {  // made for its owner alone from the first byte on
    close(open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, S_IRUSR | S_IWUSR));
  }
  try {
    // Not from spdlog's factories, which refuse a name that the server before still has here.
    spdlog::set_default_logger(std::make_shared<spdlog::logger>("calibd", SinkOf(file, form)));
  } catch (const spdlog::spdlog_ex& error) {
    return absl::ResourceExhaustedError(absl::StrCat("log: ", error.what()));
  }
  if (form.json) {
    spdlog::default_logger()->set_formatter(MakeJsonFormatter());
  } else {
    spdlog::set_pattern("%Y-%m-%dT%H:%M:%S.%e %l %v");
  }
  spdlog::flush_on(spdlog::level::info);
  return absl::OkStatus();
}

}  // namespace calib::service
