#include "server/report/text/html.h"

#include <cstdint>

namespace calib::report {
namespace {

// Length of the UTF-8 character that begins at `at`, 0 when there is none.
std::size_t CharacterLength(const std::string& text, std::size_t at) {
  const auto byte = [&text](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t lead = byte(at);
  if (lead < 0x80) return 1;
  std::size_t length = 0;
  if (lead >= 0xC2 && lead <= 0xDF) length = 2;
  if (lead >= 0xE0 && lead <= 0xEF) length = 3;
  if (lead >= 0xF0 && lead <= 0xF4) length = 4;
  if (length == 0 || at + length > text.size()) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xC0U) != 0x80U) return 0;
  }
  return length;
}

// One theme for screen (light and dark) and print. Colours: ink for measurements, blue for the
// model, amber for what was held out, red for warnings; they differ in lightness too, so that they
// survive grey printing.
constexpr const char* kStyle = R"css(
:root{--bg:#fff;--ink:#1a1d21;--soft:#5b6470;--line:#d9dee4;--grid:#eceff2;--card:#f6f8fa;--model:#1f6fb2;--band:#1f6fb2;
--held:#b3541e;--warn:#a4262c;--warnbg:#fdf1f1;--good:#1d7a46;--prior:#a7b0ba}
@media (prefers-color-scheme:dark){:root{--bg:#14171a;--ink:#e8eaed;--soft:#a0a8b2;--line:#363c43;--grid:#262b30;--card:#1c2024;
--model:#6db3f2;--band:#6db3f2;--held:#f0a060;--warn:#ff9a9a;--warnbg:#2c1a1b;--good:#6fd39b;--prior:#5c656f}}
@media print{:root{--bg:#fff;--ink:#000;--soft:#444;--line:#bbb;--grid:#e6e6e6;--card:#fff;--model:#1f6fb2;--band:#1f6fb2}
.fit,figure,tr,.card{break-inside:avoid}details{display:none}}
*{box-sizing:border-box}
body{margin:0;background:var(--bg);color:var(--ink);font:15px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif}
main{max-width:1080px;margin:0 auto;padding:28px 24px 60px}
h1{font-size:26px;line-height:1.25;margin:0 0 4px;overflow-wrap:anywhere}h2{font-size:19px;margin:40px 0 10px;padding-top:14px;border-top:1px solid var(--line)}
h3{font-size:15px;margin:22px 0 6px}p{margin:6px 0;max-width:75ch}.sub{color:var(--soft)}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(165px,1fr));gap:10px;margin:18px 0}
.card{background:var(--card);border:1px solid var(--line);border-radius:8px;padding:10px 12px}
.card b{display:block;font-size:20px;font-weight:600;font-variant-numeric:tabular-nums}.card span{color:var(--soft);font-size:13px}
.warn{background:var(--warnbg);border-left:4px solid var(--warn);padding:8px 14px;margin:14px 0;border-radius:0 6px 6px 0}
.warn ul{margin:4px 0;padding-left:20px}
.scroll{overflow-x:auto}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:14px;width:100%}
th,td{padding:5px 10px;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}
th{color:var(--soft);font-weight:600;font-size:13px}th:first-child,td:first-child{text-align:left}td.l,th.l{text-align:left}
td.wide{white-space:normal;min-width:150px}td.bad{color:var(--warn);font-weight:600}td.good{color:var(--good)}
.grid{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(320px,100%),1fr));gap:16px}
figure{margin:0}.fit{grid-template-columns:repeat(auto-fit,minmax(min(440px,100%),1fr))}figcaption{font-size:13px;color:var(--soft)}
svg{display:block;max-width:100%;height:auto}svg text{fill:var(--ink);font-size:12px}svg .tick{fill:var(--soft);font-size:11px}
.axis{stroke:var(--soft);fill:none;stroke-width:1}.gridline{stroke:var(--grid);stroke-width:1}.zero{stroke:var(--soft);stroke-dasharray:3 3}
.band{fill:var(--band);fill-opacity:.2;stroke:none}.mean{stroke:var(--model);fill:none;stroke-width:2}
.band.held{fill:var(--held)}.mean.held{stroke:var(--held)}.effect{stroke:var(--good);fill:none;stroke-width:2}
.point{fill:var(--ink)}.error{stroke:var(--ink);stroke-opacity:.55;fill:none;stroke-width:1}
.residual{fill:var(--model)}.residual.held{fill:var(--held)}
.prior{stroke:var(--prior);fill:none;stroke-width:1.5;stroke-dasharray:5 3}.posterior{fill:var(--model);fill-opacity:.45;stroke:var(--model);stroke-width:1}
.sample{fill:var(--model)}.faint{fill:var(--prior);fill-opacity:.5}
.rangebar{fill:var(--grid)}.rangepart{fill:var(--model)}.rangemean{fill:var(--ink)}
pre{background:var(--card);border:1px solid var(--line);border-radius:6px;padding:12px;overflow-x:auto;font-size:13px;line-height:1.4}
summary{cursor:pointer;color:var(--soft)}dl{display:grid;grid-template-columns:max-content 1fr;gap:2px 18px;margin:0}dt{color:var(--soft)}dd{margin:0;overflow-wrap:anywhere}
.key{display:inline-block;width:18px;height:0;border-top:3px solid;vertical-align:middle;margin:0 4px 0 12px}
.bar{display:inline-block;height:10px;background:var(--model);border-radius:2px}h4{font-size:14px;margin:18px 0 6px}
)css";

}  // namespace

std::string Escape(const std::string& text) {
  std::string escaped;
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = CharacterLength(text, i);
    if (length == 0) {
      escaped += "\xEF\xBF\xBD";  // the replacement character
      ++i;
      continue;
    }
    const char c = text[i];
    const bool control = static_cast<std::uint8_t>(c) < 0x20 && c != '\n' && c != '\t';
    if (length > 1) {
      escaped += text.substr(i, length);
    } else if (c == '&') {
      escaped += "&amp;";
    } else if (c == '<') {
      escaped += "&lt;";
    } else if (c == '>') {
      escaped += "&gt;";
    } else if (c == '"') {
      escaped += "&quot;";
    } else if (c == '\'') {
      escaped += "&#39;";
    } else if (!control && c != 0x7F) {
      escaped += c;
    }
    i += length;
  }
  return escaped;
}

std::string Page(const std::string& title, const std::string& body) {
  return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
         "<meta name=\"color-scheme\" content=\"light dark\">\n<title>" +
         Escape(title) + "</title>\n<style>" + kStyle + "</style>\n</head>\n<body>\n<main>\n" +
         body + "</main>\n</body>\n</html>\n";
}

}  // namespace calib::report
