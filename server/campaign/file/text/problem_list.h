#pragma once
// Collects everything wrong with a campaign before anything is reported.

#include <string>
#include <utility>
#include <vector>

namespace calib::campaign {

/// One thing wrong in a campaign file or a file it names.
struct Problem {
  std::string file;
  int line = 0;         ///< 1-based; 0: the file as a whole
  std::string key;      ///< dotted path ("parameters.young_modulus.min") or column
  std::string message;  ///< what is wrong, what is allowed
  /// What is wrong in a word, where programs ask: columns, encoding, control_noise, held,
  /// impossible, control_mismatch; empty: none of these.
  std::string kind = {};
};
/// "campaign.yaml:12: parameters.young_modulus.min: ..."
std::string ToString(const Problem& problem);

class ProblemList {
 public:
  /// file: name of the campaign file, for Add().
  explicit ProblemList(std::string file) : file_(std::move(file)) {}

  /// A problem in the campaign file itself.
  void Add(int line, const std::string& key, const std::string& message,
           const std::string& kind = "") {
    AddIn(file_, line, key, message, kind);
  }
  /// A problem in a file that the campaign names. Control characters become spaces: a problem is
  /// one line.
  void AddIn(const std::string& file, int line, const std::string& key, const std::string& message,
             const std::string& kind = "");

  std::size_t size() const { return problems_.size(); }

  /// Campaign file first, then the files in order of first mention; by line within each. Doubles
  /// are dropped.
  std::vector<Problem> Sorted() const;

 private:
  std::string file_;
  std::vector<Problem> problems_;
};

}  // namespace calib::campaign
