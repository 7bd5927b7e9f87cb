#include <fmt/format.h>

#include <cmath>
#include <map>

#include "server/report/documents/record.h"
#include "server/report/text/people_units.h"

namespace calib::report {
namespace {

// Text as LaTeX sets it, whatever is in it.
std::string Tex(const std::string& text) {
  static const std::map<char, const char*> special = {{'\\', "\\textbackslash{}"},
                                                      {'{', "\\{"},
                                                      {'}', "\\}"},
                                                      {'$', "\\$"},
                                                      {'&', "\\&"},
                                                      {'#', "\\#"},
                                                      {'_', "\\_"},
                                                      {'%', "\\%"},
                                                      {'~', "\\textasciitilde{}"},
                                                      {'^', "\\textasciicircum{}"}};
  std::string tex;
  for (const char c : text) {
    const auto found = special.find(c);
    if (found != special.end()) {
      tex += found->second;
    } else {
      tex += c;
    }
  }
  return tex;
}

std::string Cell(double value, int digits) {
  if (!std::isfinite(value)) return "--";
  const std::string text = Number(value, digits);
  const std::size_t e = text.find('e');
  if (e == std::string::npos) return "$" + text + "$";
  return fmt::format("${} \\times 10^{{{}}}$", text.substr(0, e), std::stoi(text.substr(e + 1)));
}

}  // namespace

std::string LatexTable(const CampaignView& view) {
  std::string rows;
  const auto add = [&rows](const v1::Posterior::Parameter& p) {
    if (p.conditioned_on() || p.nuisance()) return;
    const DisplayUnit unit = UnitForPeople(p.name(), p.unit(), std::abs(p.mean()));
    const auto cell = [&unit](double value, int digits) {
      return Cell(value * unit.factor, digits);
    };
    rows += fmt::format("{} & {} & {} & {} & {} & {} & {} \\\\\n", Tex(NameForPeople(p.name())),
                        unit.label.empty() ? "--" : Tex(unit.label), cell(p.mean(), 4),
                        cell(p.sd(), 2), cell(p.q05(), 3), cell(p.q50(), 3), cell(p.q95(), 3));
  };
  for (const auto& p : view.posterior.parameters()) add(p);
  for (const auto& p : view.posterior.members()) add(p);
  if (rows.empty()) return "";
  return "% \\usepackage{booktabs}\n\\begin{table}\n\\centering\n\\caption{Posterior of " +
         Tex(view.campaign.name) +
         ".}\n\\begin{tabular}{llrrrrr}\n\\toprule\nparameter & unit & mean & sd & 5\\,\\% & "
         "50\\,\\% & 95\\,\\% \\\\\n\\midrule\n" +
         rows + "\\bottomrule\n\\end{tabular}\n\\end{table}\n";
}

}  // namespace calib::report
