#pragma once
// Collects everything wrong with a campaign before anything is reported.

#include <string>
#include <vector>

#include "server/campaign/campaign.h"

namespace calib::campaign {

class ProblemList {
 public:
  /// file: name of the campaign file, for Add().
  explicit ProblemList(std::string file) : file_(std::move(file)) {}

  /// A problem in the campaign file itself.
  void Add(int line, const std::string& key, const std::string& message) {
    AddIn(file_, line, key, message);
  }
  /// A problem in a file that the campaign names. Control characters become spaces: a problem is
  /// one line.
  void AddIn(const std::string& file, int line, const std::string& key, const std::string& message);

  std::size_t size() const { return problems_.size(); }

  /// Campaign file first, then the files in order of first mention; by line within each. Doubles
  /// are dropped.
  std::vector<Problem> Sorted() const;

 private:
  std::string file_;
  std::vector<Problem> problems_;
};

}  // namespace calib::campaign
