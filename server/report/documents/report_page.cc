#include "server/report/documents/report_page.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "absl/strings/str_replace.h"

namespace calib::report {
namespace {

std::string Escaped(const std::string& text) {
  return absl::StrReplaceAll(text, {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}});
}

// What stands in a script element ends at the first "</", so that no "<" may stand in it. In JSON
// it occurs in strings alone.
std::string Embedded(const std::string& json) {
  return absl::StrReplaceAll(json, {{"<", "\\u003c"}});
}

std::string Quoted(const std::string& text) {
  return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace

std::string ReportPage(const std::string& campaign, const std::string& title,
                       const DocumentsByPath& documents, const PageFiles& files) {
  std::string held;
  for (const auto& [path, json] : documents) {
    held += (held.empty() ? "" : ",\n") + Quoted(path) + ": " + json;
  }
  const std::string data =
      Embedded("{\"campaign\": " + Quoted(campaign) + ", \"documents\": {" + held + "}}");
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src "
      "'unsafe-inline'; script-src 'sha256-{}'\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta name=\"color-scheme\" content=\"light dark\">\n<title>{}</title>\n<style>{}</style>\n"
      "</head>\n<body>\n<noscript>The figures of this report are drawn by the script that stands "
      "in it.</noscript>\n<script type=\"application/json\" id=\"documents\">{}</script>\n"
      "<script type=\"module\">{}</script>\n</body>\n</html>\n",
      files.script_hash, Escaped(title), files.style, data, files.script);
}

}  // namespace calib::report
