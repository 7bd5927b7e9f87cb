#pragma once
// The terminal that standard output goes to.

#include "server/report/text/terminal_plot.h"

namespace calib::ctl {

/// Width by the terminal, else $COLUMNS, else 80; UTF-8 by $LC_ALL, $LC_CTYPE or $LANG, the first
/// that is set; colours on a terminal alone, and not with $NO_COLOR (no-color.org) or TERM=dumb.
report::TerminalStyle ThisTerminal();

/// Whether a person can be asked: standard input and error output are a terminal.
bool CanAsk();

}  // namespace calib::ctl
