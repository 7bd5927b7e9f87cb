#include "dem/registry/catalog.h"
#include "server/campaign/keys/bounds.h"
#include "server/campaign/keys/sections.h"
#include "server/campaign/keys/words.h"

namespace calib::campaign {
namespace {

constexpr int kMostSkipped = 1'000'000;  // Chosen: beyond any file of readings

std::vector<Offered> ObservablesOffered() {
  std::vector<Offered> offered;
  for (const dem::ObservableInfo& info : dem::Observables()) {
    offered.push_back(
        {info.name, info.description + (info.unit == "1" ? "" : " [" + info.unit + "]")});
  }
  return offered;
}

// A map of NAME: one thing, where names are of observables (and of others with runs made
// elsewhere).
Section OfObservables(std::string name, std::string title, Form form, std::string standard,
                      std::string meaning) {
  return {std::move(name),
          std::move(title),
          {{"NAME", std::move(form), std::move(standard), std::move(meaning)}},
          ObservablesOffered()};
}

Section Data() {
  return {"data",
          "experiments[].data",
          {
              {"file", Text(), kRequired, "a table as text, or an .xlsx workbook"},
              {"columns", MapOf("columns"), "names that agree", "our names of the file's columns"},
              {"units", MapOf("units"), "SI", "of the columns"},
              {"strain", OneWord(kStrainWords), WordOf(kStrainWords, Strain::kEngineering),
               "as the laboratory computed it; converted: e_log = -ln(1 - e)"},
              {"sign", MapOf("signs"), "1", "turns a column; compression is positive here"},
              {"offset", MapOf("offsets"), "0",
               "what columns read where there is nothing to read; taken off"},
              {"zero", OneOrMore(Text()), "none",
               "names whose first reading is that offset; `first`: of all strains"},
              {"formulas", MapOf("formulas"), "none",
               "columns computed of columns, which `columns` may name"},
              {"separator", Text(), "found", "what parts cells", "`;` `,` `tab` `blanks`"},
              {"decimal", OneWord({"point", "comma"}), "found", "decimal mark"},
              {"skip", Whole(0, kMostSkipped), "found", "lines before the header"},
              {"header", OneWord({"none"}), "found", "columns are called 1, 2, ..."},
              {"rows", Text(), "all", "rows that are read, from 1", "`3-40`, `3-`, `5`"},
              {"where", MapOf("where"), "all", "rows that are read, by the text in a column"},
              {"missing", OneOrMore(Text()), "none",
               "words for what is missing, beside empty cells, NaN, NA, N/A"},
              {"sheet", Text(), "the only one with numbers",
               "of an .xlsx workbook: values stored with formulas, those shown in percent times a "
               "hundred; needs python3-openpyxl"},
          }};
}

Section Formulas() {
  return {"formulas",
          "experiments[].data.formulas",
          {{"NAME", Text(), "", "formula of the file's numbers; `$N` is column N"}}};
}

Section Where() {
  return {"where",
          "experiments[].data.where",
          {{"COLUMN", Text(), "", "the text that its cells hold in the rows that are read"}}};
}

Section ObservableKeys() {
  return {"observable",
          "experiments[].observables.NAME",
          {
              {"noise", MapOf("law"), "required but with `ess_target`", "error of a reading"},
              {"weight", Number("1", kPositive), "1", "w_j of `ess_target`"},
          }};
}

Section Law() {
  return {"law",
          "experiments[].observables.NAME.noise",
          {
              {"relative", Number("1", kPositive), "one of four",
               "sd = sqrt((relative y)^2 + floor^2)"},
              {"floor", NumberOfCatalogue(), "0", "beside `relative`; what reaches zero needs it"},
              {"absolute", NumberOfCatalogue(), "one of four", "sd of all readings"},
              {"column", Text(), "one of four",
               "sd of each reading: a column of the file in the observable's unit"},
              {"covariance", Text(), "one of four",
               "file of n rows of n numbers for n readings, in the square of the column's unit"},
              {"correlation_length", NumberOfCatalogue(), "0",
               "beside the first three: errors correlated as exp(-distance / l) along the path "
               "travelled, in units of the control"},
          }};
}

}  // namespace

std::vector<Section> SectionsOfData() {
  return {Data(),
          OfObservables("columns", "experiments[].data.columns", Text(), "the name itself",
                        "column of the file"),
          OfObservables("units", "experiments[].data.units", Text(), "SI", "unit of the column"),
          OfObservables("signs", "experiments[].data.sign", Whole(-1, 1), "1", "1 or -1"),
          OfObservables("offsets", "experiments[].data.offset", NumberOfCatalogue(), "0",
                        "in the sign of the file"),
          Formulas(),
          Where(),
          OfObservables("observables", "experiments[].observables",
                        AnyOf({MapOf("observable"), Nothing()}), "", "an observable and its error"),
          ObservableKeys(),
          Law()};
}

}  // namespace calib::campaign
