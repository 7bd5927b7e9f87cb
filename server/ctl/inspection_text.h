#pragma once
// An inspection in words, a table and a plot.

#include <string>

#include "server/inspection/inspection.h"
#include "server/report/text/terminal_plot.h"

namespace calib::ctl {

/// At most 100 columns; the plot in the terminal's.
std::string InspectionText(const inspection::Inspection& inspection,
                           const report::TerminalStyle& style);

}  // namespace calib::ctl
