#pragma once
// A server's core over a fresh store for each input: a campaign of eight small runs (c1) that is
// planned, and the contents that it names. No network, no log.

#include <memory>
#include <string>

#include "server/service/core.h"

namespace calib::fuzz {

class ServiceUnderFuzz {
 public:
  /// Ends the program where the store cannot be taken up.
  ServiceUnderFuzz();
  /// The same of what it leaves behind: a server has to start on it. What is on its way to the disk
  /// is written first.
  ~ServiceUnderFuzz();
  ServiceUnderFuzz(const ServiceUnderFuzz&) = delete;
  ServiceUnderFuzz& operator=(const ServiceUnderFuzz&) = delete;

  service::Core& core() { return *core_; }
  static const std::string& Folder();
  /// Runs `task` on the strand and waits for it.
  void OnStrand(const std::function<void()>& task);
  /// Waits until what has been said so far has led to all that follows from it: writes, plans, and
  /// what is sent then.
  void Settle();

  /// The SHA-256 of a content of the campaign, by the word "packing" or "data"; another text as it
  /// is, so that corpora do not depend on what the files hold.
  static std::string DigestOf(const std::string& word);

 private:
  std::unique_ptr<service::Core> core_;
};

}  // namespace calib::fuzz
