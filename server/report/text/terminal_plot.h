#pragma once
// Curves as text: braille dots where the terminal shows them, letters in ASCII otherwise. Knows
// nothing of campaigns and of what terminal it is; the caller says.

#include <string>
#include <vector>

namespace calib::report {

/// What a terminal can show.
struct TerminalStyle {
  int columns = 80;     ///< width, at least 20; a plot takes no more than this
  bool utf8 = false;    ///< braille and box signs; otherwise ASCII alone
  bool colour = false;  ///< ANSI colours of curves
};

/// One curve; points that are not finite part it.
struct TerminalCurve {
  std::string name;  ///< in the legend; empty: none
  std::vector<double> x{}, y{};
  bool joined = true;  ///< neighbouring points by lines; false: each point alone
};

struct TerminalAxes {
  std::string x{}, y{};  ///< what they show, with the unit
  int rows = 12;         ///< of the plotting area, 3 to 100
};

/// The plot, its axes with the numbers at their ends, and a legend where there is more than one
/// curve, in lines of at most style.columns signs, each ended by '\n'. Where curves cannot be told
/// by colour, each but the first has a sign of its own. Empty where no point is finite. Pure.
std::string TerminalPlot(const std::vector<TerminalCurve>& curves, const TerminalAxes& axes,
                         const TerminalStyle& style);

}  // namespace calib::report
