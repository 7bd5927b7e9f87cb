#include "server/campaign/file/shared/read_context.h"

#include <algorithm>
#include <cctype>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {

const std::string* ReadContext::ReadNamedFile(const MapReader& map, const std::string& key,
                                              const std::string& path) {
  auto known = contents_.find(path);
  if (known == contents_.end()) {
    auto content = reader_(path);
    known = contents_.emplace(path, std::nullopt).first;
    if (content.ok()) {
      known->second = *std::move(content);
      files_.push_back(path);
    } else {
      const std::string plain = path.ends_with('/') ? path.substr(0, path.size() - 1) : path;
      map.Problem(key, absl::StrCat("cannot read ", Quoted(plain), ": ", content.status().message(),
                                    "; relative paths start at the folder of the campaign file"));
    }
  }
  return known->second ? &*known->second : nullptr;
}

void ReadContext::AddTableProblems(const std::string& path,
                                   const std::vector<TableProblem>& found) {
  for (const TableProblem& problem : found) {
    problems_.AddIn(path, problem.line, problem.column, problem.message, problem.kind);
  }
}

bool IsShortWord(const std::string& name) {
  const auto plain = [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_' || c == '-' || c == '.' || c == '+';
  };
  constexpr std::size_t kLongest = 64;
  return !name.empty() && name.size() <= kLongest && std::all_of(name.begin(), name.end(), plain);
}

std::string ReadShortName(MapReader& map, bool is_new) {
  std::string name = map.RequiredText("name", "a short word, e.g. tx02").value_or("");
  if (map.Has("name") && !IsShortWord(name)) {
    map.Problem("name",
                absl::StrCat(Quoted(name), " is not a short word of letters, digits and _ - . +"));
  }
  const unsigned char first = name.empty() ? 'a' : static_cast<unsigned char>(name.front());
  if (is_new && std::isalnum(first) == 0 && first != '_') {  // a folder of this name: ..
    map.Problem("name", absl::StrCat(Quoted(name), " has to begin with a letter, a digit or _"));
  }
  return name;
}

}  // namespace calib::campaign
