#include "server/campaign/file/shared/read_context.h"

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

}  // namespace calib::campaign
