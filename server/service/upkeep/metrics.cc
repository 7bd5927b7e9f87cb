#include "server/service/upkeep/metrics.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace calib::service {
namespace {

/// A label's value as the format wants it.
std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\\' || c == '"') escaped += '\\';
    escaped += c == '\n' ? ' ' : c;
  }
  return escaped;
}

class Text {
 public:
  void Begin(const std::string& name, const char* type, const char* help) {
    absl::StrAppend(&text_, "# HELP calib_", name, " ", help, "\n# TYPE calib_", name, " ", type,
                    "\n");
  }
  template <typename Number>
  void Value(const std::string& name, const Number& value, const std::string& labels = "") {
    absl::StrAppend(&text_, "calib_", name, labels.empty() ? "" : absl::StrCat("{", labels, "}"),
                    " ", Digits(value), "\n");
  }
  template <typename Number>
  void Gauge(const std::string& name, const char* help, const Number& value) {
    Begin(name, "gauge", help);
    Value(name, value);
  }
  void Histogram(const std::string& name, const char* help,
                 const store::Durations::Counts& counts) {
    Begin(name, "histogram", help);
    std::uint64_t sum = 0;
    for (std::size_t k = 0; k < counts.within.size(); ++k) {
      sum += counts.within[k];
      Value(name + "_bucket", sum,
            k < store::Durations::kBounds.size()
                ? absl::StrCat("le=\"", store::Durations::kBounds[k], "\"")
                : std::string("le=\"+Inf\""));
    }
    Value(name + "_sum", counts.seconds);
    Value(name + "_count", sum);
  }
  std::string Take() { return std::move(text_); }

 private:
  static std::string Digits(double value) { return absl::StrFormat("%.12g", value); }
  template <typename Whole>
  static std::string Digits(Whole value) {
    return absl::StrCat(value);
  }

  std::string text_;
};

}  // namespace

std::string MetricsText(const Measured& m) {
  Text text;
  text.Begin("build_info", "gauge", "The mechanics of this server.");
  text.Value("build_info", 1, absl::StrCat("engine=\"", Escaped(m.engine), "\""));
  text.Gauge("uptime_seconds", "Since the server started.", m.seconds);

  text.Gauge("campaigns", "Campaigns that are not over.", m.campaigns);
  text.Gauge("campaigns_being_read",
             "Those that were there at the start and are still being read; workers wait for them.",
             m.being_read);
  text.Gauge("campaigns_planning", "Those whose next iteration is being computed.", m.planning);
  text.Gauge("queue_evaluations", "Evaluations that wait for a slot.", m.queued);
  text.Begin("workers", "gauge", "Workers by state; a draining one is connected too.");
  text.Value("workers", m.workers, "state=\"connected\"");
  text.Value("workers", m.draining, "state=\"draining\"");
  text.Value("workers", m.silent, "state=\"silent\"");
  text.Begin("slots", "gauge", "Slots of connected workers by state.");
  text.Value("slots", m.busy, "state=\"busy\"");
  text.Value("slots", m.slots - m.busy, "state=\"free\"");
  text.Begin("slots_held", "gauge", "Slots by the owner of the campaigns whose runs hold them.");
  for (const auto& [owner, held] : m.held) {
    text.Value("slots_held", held, absl::StrCat("owner=\"", Escaped(owner), "\""));
  }

  const auto& written = m.store.written;
  text.Begin("runs_total", "counter", "Attempts that ended, by how.");
  for (std::size_t k = 0; k < written.ended.size(); ++k) {
    text.Value("runs_total", written.ended[k],
               absl::StrCat("end=\"", ToString(static_cast<store::AttemptOutcome>(k)), "\""));
  }
  text.Begin("lease_expiries_total", "counter", "Attempts whose worker was not heard in time.");
  text.Value("lease_expiries_total",
             written.ended[static_cast<std::size_t>(store::AttemptOutcome::kLost)]);
  text.Begin("states_total", "counter", "States that were stored.");
  text.Value("states_total", written.states);

  text.Histogram("strand_lag_seconds", "From a task of the scheduler's thread to its begin.",
                 m.strand_lag);
  text.Histogram("commit_seconds", "From the begin of a transaction until it is on disk.",
                 m.store.commits);
  text.Histogram("ack_seconds", "From a write, as of states that came, to its acknowledgement.",
                 m.acknowledgements);
  text.Gauge("store_queue_writes", "Writes that wait for the next commit.", m.store.waiting);
  text.Gauge("store_waits", "1 while the disk of the state takes nothing.", m.store_waits ? 1 : 0);
  text.Gauge("database_bytes", "Of the state file.", m.store.file_bytes);
  text.Gauge("wal_bytes", "Of the write-ahead log beside it.", m.store.wal_bytes);
  return text.Take();
}

}  // namespace calib::service
