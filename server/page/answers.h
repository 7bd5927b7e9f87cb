#pragma once
// Documents that were asked for, kept for as long as nothing that they tell has changed, so that
// any number of browsers cost the server what one does.

#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "server/client/load_view.h"
#include "server/page/askers.h"
#include "server/page/question.h"

namespace calib::page {

/// A document as it is sent.
struct Kept {
  std::shared_ptr<const std::string> plain{};
  std::shared_ptr<const std::string> gzip{};  ///< null: not worth it
  std::string etag{};                         ///< of the content, whatever its encoding
};
Kept MakeKept(std::string content);

/// Lives on one thread (HttpServer's), to which `post` brings what others have found.
class Answers {
 public:
  using Then = std::function<void(const absl::StatusOr<Kept>&)>;

  Answers(const Connect& connect, std::function<void(std::function<void()>)> post)
      : post_(std::move(post)),
        quick_(connect, kQuickThreads, 0),
        slow_(connect, kSlowThreads, kSlowNiceness) {}

  /// stamp: tells what the document depends on; what was found at an equal one is given at once,
  /// and who asks while it is being found waits for that. Empty: it is found anew, and kept for
  /// nobody but those who wait for it. RESOURCE_EXHAUSTED: too much is asked at a time.
  void Get(const Question& question, const std::string& stamp, Then then);

 private:
  static constexpr int kQuickThreads = 2;
  static constexpr int kSlowThreads = 1;   // comparisons, which take up to seconds
  static constexpr int kSlowNiceness = 5;  // what the service does for workers goes first
  static constexpr std::size_t kMostBytes = 64 << 20;

  struct Entry {
    std::string stamp{};
    Kept kept{};
    std::list<std::string>::iterator used{};
  };
  void Found(const std::string& key, const std::string& stamp, const absl::StatusOr<Kept>& found);
  void Keep(const std::string& key, const std::string& stamp, const Kept& kept);
  static std::size_t BytesOf(const Kept& kept);

  const std::function<void(std::function<void()>)> post_;
  std::map<std::string, Entry> kept_;  // by key of the question
  std::list<std::string> used_;        // keys, the last used first
  std::size_t bytes_ = 0;
  std::map<std::pair<std::string, std::string>, std::vector<Then>> waiting_;  // by key and stamp
  client::CampaignShelf shelf_;                                               // of the askers
  Askers quick_, slow_;                                                       // go first
};

}  // namespace calib::page
