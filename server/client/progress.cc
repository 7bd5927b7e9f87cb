#include "server/client/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>
#include <utility>

#include "server/messages/read_words.h"
#include "server/report/text/people_units.h"

namespace calib::client {

using campaign::CampaignState;

namespace {

constexpr int kBarWidth = 20;

std::string Bar(int done, int of) {
  const int filled = of > 0 ? std::clamp(kBarWidth * done / of, 0, kBarWidth) : 0;
  return "[" + std::string(static_cast<std::size_t>(filled), '#') +
         std::string(static_cast<std::size_t>(kBarWidth - filled), '-') + "]";
}

}  // namespace

std::string ProgressText(const v1::CampaignStatus& s) {
  const auto state = messages::StateOf(s);
  if (state != CampaignState::kRunning && state != CampaignState::kQueued) {
    return s.state() + (s.reason().empty() ? "" : ": " + s.reason());
  }
  if (messages::PhaseOf(s) == campaign::Phase::kValidating) return "held-out tests";
  std::string text = fmt::format("iteration {}/{}", s.iteration() + 1, s.max_iterations());
  text += fmt::format("  {}  {}/{} samples", Bar(s.samples_done(), s.samples()), s.samples_done(),
                      s.samples());
  // Audited or run again on other packings, or what follows is computed.
  if (s.samples() > 0 && s.samples_done() == s.samples()) text += "  concluding";
  if (s.samples_running() > 0) text += fmt::format("  {} running", s.samples_running());
  if (s.samples_resting() > 0) text += fmt::format("  {} resting", s.samples_resting());
  if (s.samples_stopped_early() > 0) {
    text += fmt::format("  {} stopped early", s.samples_stopped_early());
  }
  if (s.samples_diverged() > 0) text += fmt::format("  {} diverged", s.samples_diverged());
  if (s.samples_unknown() > 0) text += fmt::format("  {} unknown", s.samples_unknown());
  if (s.effective_sample_size() > 0) {
    text += "  ESS " + report::Number(s.effective_sample_size(), 2);
  }
  if (s.best_misfit() > 0) text += "  best misfit " + report::Number(s.best_misfit(), 2);
  if (s.eta_seconds() > 0) text += "  " + report::Duration(s.eta_seconds()) + " left";
  return text;
}

ProgressLine::ProgressLine(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}

ProgressLine::~ProgressLine() {
  if (drawn_) std::cerr << "\n";
}

void ProgressLine::Show(const std::string& text, int milestone) {
  if (quiet_) return;
  if (terminal_) {
    std::cerr << "\r\x1b[K" << text << std::flush;
    drawn_ = true;
    return;
  }
  const auto now = std::chrono::steady_clock::now();
  if (milestone == last_milestone_ || now - last_ < std::chrono::seconds(1)) return;
  std::cerr << text << "\n";
  last_milestone_ = milestone;
  last_ = now;
}

BusyLine::BusyLine(std::string what) {
  if (isatty(STDERR_FILENO) != 0) drawer_ = std::thread(&BusyLine::Draw, this, std::move(what));
}

BusyLine::~BusyLine() {
  if (!drawer_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    over_ = true;
  }
  ended_.notify_all();
  drawer_.join();
}

void BusyLine::Draw(const std::string& what) {
  constexpr int kSilent = 2;  // s
  std::unique_lock lock(mutex_);
  bool drawn = false;
  for (int seconds = 1; !ended_.wait_for(lock, std::chrono::seconds(1), [this] { return over_; });
       ++seconds) {
    if (seconds <= kSilent) continue;
    std::cerr << "\r\x1b[K" << what << "  " << report::Duration(seconds) << std::flush;
    drawn = true;
  }
  if (drawn) std::cerr << "\r\x1b[K" << std::flush;
}

}  // namespace calib::client
