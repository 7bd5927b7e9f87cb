// What physics says of columns: names, units and signs that headings leave open or lie about.
#include <gtest/gtest.h>

#include <functional>

#include "absl/strings/str_cat.h"
#include "tests/unit/inspection/tables.h"

namespace calib::inspection {
namespace {

// A table of the known test with one more column.
std::string With(const std::string& heads,
                 const std::function<std::string(const KnownTest&, std::size_t)>& row) {
  const KnownTest test = MakeKnownTest();
  std::string text = heads + "\n";
  for (std::size_t i = 0; i < test.ea.size(); ++i) absl::StrAppend(&text, row(test, i), "\n");
  return text;
}

TEST(Relations, ThePathSaysWhichMeanStressPIs) {
  for (const double share : {1.0 / 3, 1.0 / 2, 1.0}) {
    const Inspection inspection =
        InspectText(With("eps1 [%],q [kPa],p [kPa]", [share](const KnownTest& t, std::size_t i) {
          return absl::StrCat(t.ea[i] * 100, ",", t.q[i] / 1e3, ",", 200 + t.q[i] / 1e3 * share);
        }));
    const bool mean = inspection.Find("mean_stress") != nullptr;
    SCOPED_TRACE(share);
    EXPECT_EQ(mean && !inspection.IsOpen(), share < 0.4);
    EXPECT_EQ(inspection.Find("(axial + lateral stress)/2") != nullptr, share > 0.4 && share < 0.6);
    EXPECT_EQ(inspection.IsOpen(), share == 1.0);
  }
}

// Without lateral strain the lateral stress is not held, and a slope of one is any earth pressure.
TEST(Relations, ThePathOfAnOedometerSaysNothingOfP) {
  const Inspection inspection =
      InspectText(With("eps1 [%],q [kPa],p [kPa],e", [](const KnownTest& t, std::size_t i) {
        const double p = 100 + 5e4 * t.ea[i];
        return absl::StrCat(t.ea[i] * 100, ",", p - 60, ",", p, ",", 0.7 - 1.7 * t.ea[i]);
      }));
  EXPECT_NE(inspection.Find("mean_stress"), nullptr);
  EXPECT_FALSE(inspection.IsOpen());
}

TEST(Relations, VoidsTellPercentFromPlainNumbers) {
  for (const double scale : {1.0, 100.0}) {
    const Inspection inspection =
        InspectText(With("epsv,e,eps1", [scale](const KnownTest& t, std::size_t i) {
          // Below one in either unit: nothing but the voids tells them.
          return absl::StrCat(t.ev[i] * scale * 0.1, ",", 0.7 - 1.7 * t.ev[i] * 0.1, ",",
                              t.ea[i] * scale * 0.1 / 2);
        }));
    const ColumnMeaning* volume = inspection.Find("volumetric_strain");
    ASSERT_NE(volume, nullptr);
    EXPECT_EQ(volume->unit, scale == 1 ? "1" : "percent");
    EXPECT_FALSE(inspection.IsOpen());
  }
}

TEST(Relations, AHeaderThatLiesAboutItsUnitIsNotFollowed) {
  const Inspection inspection =
      InspectText(With("eps1[%],epsv[%],e[-],q[kPa]", [](const KnownTest& t, std::size_t i) {
        return absl::StrCat(t.ea[i] * 100, ",", t.ev[i], ",", t.e[i], ",", t.q[i] / 1e3);
      }));
  EXPECT_TRUE(Says(inspection, FindingKind::kUnits, "epsv"));
  EXPECT_TRUE(inspection.IsOpen());
}

TEST(Relations, StressesOfDifferentUnitsDoNotAddUp) {
  const Inspection inspection = InspectText(
      With("eps1[%],sigma1[kPa],sigma3[kPa],q[MPa]", [](const KnownTest& t, std::size_t i) {
        return absl::StrCat(t.ea[i] * 100, ",", 200 + t.q[i] / 1e3, ",200,", t.q[i] / 1e3);
      }));
  EXPECT_TRUE(Says(inspection, FindingKind::kUnits, "'q'"));
  EXPECT_TRUE(IsOdd(inspection));
}

TEST(Relations, NegativeCompressionIsTurned) {
  const Inspection inspection =
      InspectText(With("eps1[%],epsv[%],e[-],q[kPa]", [](const KnownTest& t, std::size_t i) {
        return absl::StrCat(-t.ea[i] * 100, ",", -t.ev[i] * 100, ",", t.e[i], ",", t.q[i] / 1e3);
      }));
  ASSERT_NE(inspection.Find("axial_strain"), nullptr);
  EXPECT_EQ(inspection.Find("axial_strain")->sign, -1);
  EXPECT_EQ(inspection.Find("volumetric_strain")->sign, -1);
  EXPECT_NEAR(inspection.Values(0, "axial_strain").back(), 0.1, 1e-9);
}

TEST(Relations, DilationThatIsPositiveIsAskedForWhereNothingElseTells) {
  const Inspection inspection =
      InspectText(With("eps1[%],epsv[%],q[kPa]", [](const KnownTest& t, std::size_t i) {
        return absl::StrCat(t.ea[i] * 100, ",", -t.ev[i] * 100, ",", t.q[i] / 1e3);
      }));
  EXPECT_TRUE(inspection.IsOpen());
  EXPECT_TRUE(Says(inspection, FindingKind::kAmbiguous, "epsv"));
}

TEST(Relations, ConfiningPressureOfTheNameAndOfTheFileAreCompared) {
  const std::string text = With("eps1[%],q[kPa],p[kPa]", [](const KnownTest& t, std::size_t i) {
    return absl::StrCat(t.ea[i] * 100, ",", t.q[i] / 1e3, ",", t.p[i] / 1e3);
  });
  EXPECT_FALSE(IsOdd(InspectText(text, {}, "tx_200kPa.csv")));
  EXPECT_TRUE(IsOdd(InspectText(text, {}, "tx_100kPa.csv")));
}

TEST(Relations, ForceOverTheFirstAreaIsNotCorrected) {
  for (const bool corrected : {false, true}) {
    const std::string text = "diameter: 50 mm, height: 100 mm\n" +
                             With("load[N],displacement[mm],eps1[%],q[kPa]",
                                  [corrected](const KnownTest& t, std::size_t i) {
                                    const double area = 1963.5e-6 / (corrected ? 1 - t.ea[i] : 1);
                                    return absl::StrCat(t.q[i] * area, ",", t.ea[i] * 100, ",",
                                                        t.ea[i] * 100, ",", t.q[i] / 1e3);
                                  });
    const Inspection inspection = InspectText(text);
    EXPECT_TRUE(
        Says(inspection, FindingKind::kStressPath, corrected ? "corrected by" : "not corrected"));
    EXPECT_EQ(IsOdd(inspection), !corrected);
    EXPECT_TRUE(Says(inspection, FindingKind::kUnits, "gauge length of 100 mm"));
  }
}

}  // namespace
}  // namespace calib::inspection
