#pragma once
// Tables for tests of inspections: one drained triaxial test, computed from formulas, in any form.

#include <cmath>
#include <string>
#include <vector>

#include "server/inspection/inspection.h"

namespace calib::inspection {

/// A drained triaxial test at 200 kPa: hyperbolic strength, contraction before dilation.
struct KnownTest {
  std::vector<double> ea, ev, q, p, e;  ///< plain numbers and Pa
};
inline KnownTest MakeKnownTest(int rows = 40) {
  KnownTest test;
  for (int i = 0; i < rows; ++i) {
    const double ea = 0.10 * i / (rows - 1);
    const double ev = 0.02 * ea / 0.01 * std::exp(-ea / 0.01) * 0.2 - 0.3 * ea * ea / 0.1;
    const double q = 400e3 * ea / (ea + 0.005);
    test.ea.push_back(ea);
    test.ev.push_back(ev);
    test.q.push_back(q);
    test.p.push_back(200e3 + q / 3);
    test.e.push_back(1.7 * (1 - ev) - 1);
  }
  return test;
}

inline Inspection InspectText(const std::string& bytes, const std::vector<SaidMeaning>& said = {},
                              const std::string& file = "d.csv") {
  std::vector<campaign::TableProblem> problems;
  Inspection inspection = Inspect(file, bytes, said, problems);
  if (!problems.empty()) inspection.file = "problem: " + problems.front().message;
  return inspection;
}

inline bool Says(const Inspection& inspection, FindingKind kind, const std::string& part = "") {
  for (const Finding& finding : inspection.findings) {
    if (finding.kind == kind && finding.text.find(part) != std::string::npos) return true;
  }
  return false;
}

inline bool IsOdd(const Inspection& inspection) {
  for (const Finding& finding : inspection.findings) {
    if (finding.odd) return true;
  }
  return false;
}

}  // namespace calib::inspection
