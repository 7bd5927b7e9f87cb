#include "server/ctl/shell/man_pages.h"

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"

namespace calib::ctl {
namespace {

// A text that roff sets as it is: \- is a minus, a dot or quote that begins a line no request.
std::string Roff(const std::string& text) {
  const std::string escaped =
      absl::StrReplaceAll(text, {{"\\", "\\e"}, {"-", "\\-"}, {"~", "\\(ti"}, {"^", "\\(ha"}});
  const bool is_request = escaped.starts_with('.') || escaped.starts_with('\'');
  return is_request ? "\\&" + escaped : escaped;
}

std::string Title(const std::string& name, const std::string& description) {
  return absl::StrCat(".TH ", absl::AsciiStrToUpper(Roff(name)), " 1 \"\" calib calib\n.SH NAME\n",
                      Roff(name), " \\- ", Roff(description), "\n");
}

std::string OptionItems(const std::vector<OptionEntry>& options) {
  std::string text;
  for (const OptionEntry& option : options) {
    std::vector<std::string> names;
    names.reserve(option.names.size());
    for (const std::string& name : option.names) {
      names.push_back(absl::StrCat(option.at_its_place ? "\\fI" : "\\fB", Roff(name), "\\fR"));
    }
    const bool named_value = option.takes_value && !option.at_its_place;
    absl::StrAppend(&text, ".TP\n", absl::StrJoin(names, ", "), named_value ? " \\fIVALUE\\fR" : "",
                    "\n", Roff(option.help), option.required ? " (required)" : "", "\n");
  }
  return text;
}

std::string Synopsis(const VerbEntry& verb) {
  std::string text = absl::StrCat(".SH SYNOPSIS\n.B calibctl ", Roff(verb.name), "\n");
  for (const OptionEntry& option : verb.options) {
    if (!option.at_its_place && !option.required) continue;
    const std::string word =
        option.at_its_place
            ? absl::StrCat("\\fI", Roff(option.names.front()), "\\fR")
            : absl::StrCat("\\fB", Roff(option.names.front()), "\\fR \\fIVALUE\\fR");
    absl::StrAppend(&text, option.required ? word : absl::StrCat("[", word, "]"), "\n");
  }
  return text + "[\\fIOPTIONS\\fR]\n";
}

std::string Page(const VerbEntry& verb, const CommandTree& tree) {
  const std::string options = OptionItems(verb.options);
  return absl::StrCat(Title("calibctl-" + verb.name, verb.description), Synopsis(verb),
                      options.empty() ? "" : ".SH OPTIONS\n", options, ".SH COMMON OPTIONS\n",
                      OptionItems(tree.common), ".SH EXAMPLE\n.nf\n",
                      Roff("calibctl " + verb.example), "\n.fi\n",
                      ".SH SEE ALSO\n.BR calibctl (1)\n");
}

}  // namespace

std::vector<std::pair<std::string, std::string>> ManPages(const CommandTree& tree) {
  std::string all =
      absl::StrCat(Title("calibctl", "calibrates discrete element models of granular materials"),
                   ".SH SYNOPSIS\n.B calibctl\n\\fICOMMAND\\fR [\\fIOPTIONS\\fR]\n.SH COMMANDS\n");
  std::vector<std::pair<std::string, std::string>> pages(1);
  for (const VerbEntry& verb : tree.verbs) {
    absl::StrAppend(&all, ".TP\n.BR calibctl\\-", Roff(verb.name), " (1)\n", Roff(verb.description),
                    "\n");
    pages.emplace_back("calibctl-" + verb.name + ".1", Page(verb, tree));
  }
  absl::StrAppend(
      &all, ".SH COMMON OPTIONS\n", OptionItems(tree.common),
      ".SH EXIT STATUS\n0: done; 1: the campaign or the request failed; 2: bad usage or "
      "bad input; 3: no server answers.\n.SH VERSION\n.nf\n",
      Roff(tree.version), "\n.fi\n");
  pages.front() = {"calibctl.1", std::move(all)};
  return pages;
}

}  // namespace calib::ctl
