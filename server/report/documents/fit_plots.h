#pragma once
// A campaign's fit and its residuals, drawn in the terminal.

#include <string>
#include <vector>

#include "server/report/text/terminal_plot.h"
#include "server/report/views/curves.h"

namespace calib::report {

/// For each observable of each experiment the readings and the model, the median over the posterior
/// or, before there is one, the best run; then for each experiment the residuals in sd. At most
/// `most` observables, those with the largest error; a line says how many there are beside. Empty:
/// nothing to draw. Pure.
std::string FitPlots(const std::vector<ExperimentCurves>& experiments, int most,
                     const TerminalStyle& style);

}  // namespace calib::report
