// One known test in every form that laboratories write gives the same numbers, or a refusal that
// names a line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "tests/unit/inspection/tables.h"

namespace calib::inspection {
namespace {

struct UnitSystem {
  const char* strain;
  double strains;  // numbers of a plain one
  const char* stress;
  double stresses;  // numbers of a Pa
};
constexpr UnitSystem kSystems[] = {{"%", 100, "kPa", 1e-3},
                                   {"-", 1, "MPa", 1e-6},
                                   {"-", 1, "Pa", 1},
                                   {"%", 100, "psi", 1 / 6894.757293168361}};

enum class Header { kBrackets, kParentheses, kUnitLine, kComment };

std::string Table(const KnownTest& test, const std::string& delimiter, bool comma, Header header,
                  const UnitSystem& units) {
  const std::vector<std::string> names = {"eps1", "epsv", "q", "p", "void_ratio"};
  const std::vector<std::string> in = {units.strain, units.strain, units.stress, units.stress, "-"};
  std::vector<std::string> heads;
  std::vector<std::string> below;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (header == Header::kBrackets) heads.push_back(names[i] + "[" + in[i] + "]");
    if (header == Header::kParentheses) heads.push_back(names[i] + " (" + in[i] + ")");
    if (header == Header::kUnitLine) heads.push_back(names[i]);
    if (header == Header::kComment) heads.push_back(names[i] + "[" + in[i] + "]");
    below.push_back("[" + in[i] + "]");
  }
  std::string text = header == Header::kComment ? "# " : "";
  absl::StrAppend(&text, absl::StrJoin(heads, delimiter), "\n");
  if (header == Header::kUnitLine) absl::StrAppend(&text, absl::StrJoin(below, delimiter), "\n");
  for (std::size_t i = 0; i < test.ea.size(); ++i) {
    std::vector<std::string> cells = {absl::StrFormat("%.6g", test.ea[i] * units.strains),
                                      absl::StrFormat("%.8g", test.ev[i] * units.strains),
                                      absl::StrFormat("%.9g", test.q[i] * units.stresses),
                                      absl::StrFormat("%.9g", test.p[i] * units.stresses),
                                      absl::StrFormat("%.8f", test.e[i])};
    std::string row = absl::StrJoin(cells, delimiter == "," && comma ? "\",\"" : delimiter);
    if (delimiter == "," && comma) row = "\"" + row + "\"";
    // In quoted cells the commas between them stay.
    if (comma) row = absl::StrReplaceAll(row, {{".", ","}});
    absl::StrAppend(&text, row, "\n");
  }
  return text;
}

std::string Utf16(const std::string& text) {
  std::string wide = "\xFF\xFE";
  for (const char c : text) wide += {c, '\0'};
  return wide;
}

void ExpectTheKnownTest(const Inspection& inspection, const KnownTest& test) {
  const auto near = [&](const char* role, const std::vector<double>& wanted, double within) {
    const std::vector<double> found = inspection.Values(0, role);
    ASSERT_EQ(found.size(), wanted.size()) << role;
    for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], wanted[i], within) << role;
  };
  near("axial_strain", test.ea, 1e-6);
  near("volumetric_strain", test.ev, 1e-7);
  near("deviatoric_stress", test.q, 1);
  near("mean_stress", test.p, 1);
  near("void_ratio", test.e, 1e-7);
}

TEST(InspectionForms, OneTestInEveryFormGivesTheSameNumbers) {
  const KnownTest test = MakeKnownTest();
  int read = 0;
  for (const std::string delimiter : {";", ",", "\t", " "}) {
    for (const bool comma : {false, true}) {
      for (const Header header :
           {Header::kBrackets, Header::kParentheses, Header::kUnitLine, Header::kComment}) {
        for (const UnitSystem& units : kSystems) {
          const std::string text = Table(test, delimiter, comma, header, units);
          for (const std::string& bytes : {text, "\xEF\xBB\xBF" + text, Utf16(text)}) {
            SCOPED_TRACE(text.substr(0, 200));
            std::vector<campaign::TableProblem> problems;
            const Inspection inspection = Inspect("d.csv", bytes, {}, problems);
            if (!problems.empty()) {
              EXPECT_GT(problems.front().line, 0) << problems.front().message;
              continue;
            }
            ++read;
            ExpectTheKnownTest(inspection, test);
            EXPECT_FALSE(inspection.IsOpen());
            EXPECT_FALSE(IsOdd(inspection));
          }
        }
      }
    }
  }
  // A comma within a comment, and a decimal comma among commas, may be refused; no other form.
  EXPECT_GE(read, 300);
}

TEST(InspectionForms, AColumnNamesTheTestsOfAFile) {
  const KnownTest test = MakeKnownTest(12);
  std::string text = "test_id,eps_a[%],q[kPa]\n";
  for (const char* name : {"A1", "A2"}) {
    for (std::size_t i = 0; i < test.ea.size(); ++i) {
      absl::StrAppend(&text, name, ",", test.ea[i] * 100, ",", test.q[i] / 1e3, "\n");
    }
  }
  const Inspection inspection = InspectText(text);
  ASSERT_EQ(inspection.tests.size(), 2U);
  EXPECT_EQ(inspection.table.naming_column, "test_id");
  EXPECT_EQ(inspection.tests[1].name, "A2");
  EXPECT_EQ(inspection.table.parts[1].lines.front(), 14);
  EXPECT_EQ(inspection.Values(1, "axial_strain").size(), 12U);
}

TEST(InspectionForms, SectionsOfOneHeaderAreTests) {
  std::string text;
  for (const char* name : {"Test A", "Test B", "Test C"}) {
    absl::StrAppend(&text, name, "\neps_a;q\n%;kPa\n0;0\n1;50\n2;80\n3;100\n\n");
  }
  const Inspection inspection = InspectText(text);
  ASSERT_EQ(inspection.tests.size(), 3U) << inspection.file;
  EXPECT_EQ(inspection.tests[1].name, "Test B");
  EXPECT_EQ(inspection.rows, 12U);
  EXPECT_EQ(inspection.Values(2, "deviatoric_stress"), (std::vector<double>{0, 50e3, 80e3, 100e3}));
}

TEST(InspectionForms, WhereNothingSaysTheUnitItIsAsked) {
  const Inspection inspection = InspectText("axial_strain,q\n0,0\n0.1,20\n0.2,35\n0.3,45\n");
  EXPECT_TRUE(inspection.IsOpen());
  std::string problem;
  const auto strain = ReadSaidMeaning("axial_strain=axial_strain[percent]", problem);
  const auto stress = ReadSaidMeaning("q=deviatoric_stress[kPa]", problem);
  ASSERT_TRUE(strain && stress) << problem;
  const Inspection told =
      InspectText("axial_strain,q\n0,0\n0.1,20\n0.2,35\n0.3,45\n", {*strain, *stress});
  EXPECT_FALSE(told.IsOpen());
  EXPECT_DOUBLE_EQ(told.Values(0, "axial_strain")[3], 0.003);
  EXPECT_DOUBLE_EQ(told.Values(0, "deviatoric_stress")[3], 45e3);
}

}  // namespace
}  // namespace calib::inspection
