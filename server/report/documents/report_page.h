#pragma once
// A report: the live page's own figures over documents that stand in the file itself.

#include <map>
#include <string>
#include <string_view>

namespace calib::report {

/// What a report holds of the live page.
struct PageFiles {
  std::string_view style;   ///< CSS
  std::string_view script;  ///< JavaScript, a module
  std::string script_hash;  ///< its SHA-256 in base64: nothing else may run
};

/// JSON documents by their paths below /api/v1, as "campaigns/c1/compare".
using DocumentsByPath = std::map<std::string, std::string>;

/// One HTML file that fetches nothing. title and whatever stands in the documents stay text. Pure.
/// documents: well-formed JSON.
std::string ReportPage(const std::string& campaign, const std::string& title,
                       const DocumentsByPath& documents, const PageFiles& files);

}  // namespace calib::report
