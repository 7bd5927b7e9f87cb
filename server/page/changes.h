#pragma once
// What changes at the server, for browsers that draw it: which documents are still what they were,
// and a line for each that may not be.

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <stop_token>
#include <string>
#include <thread>

#include "calib/v1/campaign.pb.h"
#include "server/page/askers.h"
#include "server/page/http_message.h"
#include "server/page/question.h"

namespace calib::page {

/// What is known of it all. Lives on one thread.
class Changes {
 public:
  /// instance: of this page, for the ids of events.
  explicit Changes(std::string instance) : instance_(std::move(instance)) {}

  bool is_up() const { return up_; }
  /// The server was found, and this is its first message; or it was lost.
  void Begin();
  void Lose();
  void Hear(const v1::Changes& changes);

  /// What Answers is told of a question; empty: it changes all the time, or nobody knows.
  std::string StampOf(const Question& question) const;

  /// Server-sent events [HTML standard, 9.2], from now on.
  std::shared_ptr<Feed> NewFeed();

 private:
  class EventFeed;
  struct Known {
    std::uint64_t version = 0, concluded = 0;
    double states_per_second = 0;
  };
  enum class Whole { kServer, kCampaigns, kWorkers };
  void Tell(const std::set<Whole>& whole, const std::set<std::string>& campaigns);

  const std::string instance_;
  std::uint64_t event_ = 0;  // number of the last
  std::uint64_t epoch_ = 0;  // of the server's numbers, which begin anew with it
  bool up_ = false;
  std::map<std::string, Known> campaigns_;  // those that have changed since the server started
  std::uint64_t any_ = 0;                   // the largest version of all
  std::uint64_t list_ = 0, workers_ = 0, waits_ = 0;
  std::set<EventFeed*> feeds_;
};

/// Listens to the server on a thread of its own, and goes on when it comes back.
class ChangesListener {
 public:
  /// post: brings to the thread of `changes`, which outlives this, as it does what was posted.
  ChangesListener(Connect connect, Changes& changes,
                  std::function<void(std::function<void()>)> post);

 private:
  void Run(const std::stop_token& stop);
  void Listen(client::Client& client, const std::stop_token& stop);

  const Connect connect_;
  Changes& changes_;
  const std::function<void(std::function<void()>)> post_;
  std::jthread thread_;
};

}  // namespace calib::page
