#include "server/campaign/file/text/problem_list.h"

#include <algorithm>
#include <cctype>
#include <tuple>

namespace calib::campaign {
namespace {

std::string OneLine(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }, ' ');
  return text;
}

}  // namespace

void ProblemList::AddIn(const std::string& file, int line, const std::string& key,
                        const std::string& message, const std::string& kind) {
  problems_.push_back({OneLine(file), line, OneLine(key), OneLine(message), kind});
}

std::vector<Problem> ProblemList::Sorted() const {
  std::vector<std::string> files = {file_};
  for (const Problem& problem : problems_) {
    if (std::find(files.begin(), files.end(), problem.file) == files.end()) {
      files.push_back(problem.file);
    }
  }
  std::vector<Problem> sorted;
  for (const std::string& file : files) {
    const std::size_t begin = sorted.size();
    for (const Problem& problem : problems_) {
      const bool seen = std::any_of(sorted.begin(), sorted.end(), [&problem](const Problem& other) {
        return std::tie(other.file, other.line, other.key, other.message) ==
               std::tie(problem.file, problem.line, problem.key, problem.message);
      });
      if (problem.file == file && !seen) sorted.push_back(problem);
    }
    std::stable_sort(sorted.begin() + static_cast<std::ptrdiff_t>(begin), sorted.end(),
                     [](const Problem& a, const Problem& b) { return a.line < b.line; });
  }
  return sorted;
}

std::string ToString(const Problem& problem) {
  std::string text = problem.file;
  if (problem.line > 0) text += ":" + std::to_string(problem.line);
  if (!problem.key.empty()) text += ": " + problem.key;
  return text + ": " + problem.message;
}

}  // namespace calib::campaign
