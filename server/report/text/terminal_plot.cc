#include "server/report/text/terminal_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "server/report/text/people_units.h"

namespace calib::report {
namespace {

constexpr int kLeastColumns = 20;
constexpr int kDotsWide = 2;  // of a braille sign [Unicode 15, block U+2800]
constexpr int kDotsHigh = 4;
constexpr std::array<std::array<unsigned, kDotsHigh>, kDotsWide> kDots = {
    {{0x01, 0x02, 0x04, 0x40}, {0x08, 0x10, 0x20, 0x80}}};
constexpr std::array<char, 6> kSigns = {'*', 'o', 'x', '+', '#', '@'};
// Colours that are told apart with red-green blindness too: blue, yellow, magenta, cyan.
constexpr std::array<const char*, 4> kColours = {"\033[34m", "\033[33m", "\033[35m", "\033[36m"};

struct Span {
  double from = std::numeric_limits<double>::infinity();
  double to = -std::numeric_limits<double>::infinity();
  void Take(double value) {
    from = std::min(from, value);
    to = std::max(to, value);
  }
  // Position in [0, cells).
  [[nodiscard]] int At(double value, int cells) const {
    const double share = to > from ? (value - from) / (to - from) : 0.5;
    return std::clamp(static_cast<int>(share * cells), 0, cells - 1);
  }
};

struct Cell {
  unsigned dots = 0;
  int curve = -1;  // the last that was drawn here
};

std::string Utf8Of(unsigned point) {
  return {static_cast<char>(0xE0 | (point >> 12)), static_cast<char>(0x80 | ((point >> 6) & 0x3F)),
          static_cast<char>(0x80 | (point & 0x3F))};
}

class Canvas {
 public:
  Canvas(int wide, int high, const TerminalStyle& style)
      : wide_(wide),
        high_(high),
        style_(style),
        cells_(static_cast<std::size_t>(wide) * static_cast<std::size_t>(high)) {}

  [[nodiscard]] int dots_wide() const { return wide_ * (style_.utf8 ? kDotsWide : 1); }
  [[nodiscard]] int dots_high() const { return high_ * (style_.utf8 ? kDotsHigh : 1); }

  // x from the left, y from the bottom, in dots.
  void Set(int x, int y, int curve) {
    const int down = dots_high() - 1 - y;
    const int per_x = style_.utf8 ? kDotsWide : 1;
    const int per_y = style_.utf8 ? kDotsHigh : 1;
    Cell& cell = cells_[Index(x / per_x, down / per_y)];
    cell.dots |= kDots[static_cast<std::size_t>(x % per_x)][static_cast<std::size_t>(down % per_y)];
    cell.curve = curve;
  }

  void Join(int x0, int y0, int x1, int y1, int curve) {
    const int steps = std::max({std::abs(x1 - x0), std::abs(y1 - y0), 1});
    for (int i = 0; i <= steps; ++i) {
      Set(x0 + (x1 - x0) * i / steps, y0 + (y1 - y0) * i / steps, curve);
    }
  }

  [[nodiscard]] std::string Row(int row) const {
    std::string text;
    for (int i = 0; i < wide_; ++i) {
      const Cell& cell = cells_[Index(i, row)];
      text += cell.curve < 0 ? " " : Sign(cell);
    }
    while (!text.empty() && text.back() == ' ') text.pop_back();
    return text;
  }

  // How a curve is drawn, for the legend.
  [[nodiscard]] std::string Sample(int curve) const { return Sign({0x24, curve}); }

 private:
  [[nodiscard]] std::size_t Index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(wide_) +
           static_cast<std::size_t>(column);
  }
  [[nodiscard]] std::string Sign(const Cell& cell) const {
    const auto at = static_cast<std::size_t>(cell.curve);
    const bool braille = style_.utf8 && (style_.colour || cell.curve == 0);
    std::string sign =
        braille ? Utf8Of(0x2800 + cell.dots) : std::string(1, kSigns[at % kSigns.size()]);
    if (!style_.colour) return sign;
    return absl::StrCat(kColours[at % kColours.size()], sign, "\033[0m");
  }

  int wide_, high_;
  TerminalStyle style_;
  std::vector<Cell> cells_;
};

// Cut to a number of signs; continuation bytes of UTF-8 count nothing.
std::string Cut(const std::string& text, int signs) {
  std::string cut;
  int count = 0;
  for (const char c : text) {
    const bool begins = (static_cast<unsigned char>(c) & 0xC0) != 0x80;
    if (begins && ++count > signs) break;
    cut.push_back(c);
  }
  return cut;
}

std::string Padded(const std::string& text, std::size_t width) {
  return std::string(width > text.size() ? width - text.size() : 0, ' ') + text;
}

void Draw(const TerminalCurve& curve, int number, const Span& x, const Span& y, Canvas& canvas) {
  bool joins = false;
  int last_x = 0;
  int last_y = 0;
  for (std::size_t i = 0; i < curve.x.size() && i < curve.y.size(); ++i) {
    if (!std::isfinite(curve.x[i]) || !std::isfinite(curve.y[i])) {
      joins = false;
      continue;
    }
    const int at_x = x.At(curve.x[i], canvas.dots_wide());
    const int at_y = y.At(curve.y[i], canvas.dots_high());
    if (joins && curve.joined) {
      canvas.Join(last_x, last_y, at_x, at_y, number);
    } else {
      canvas.Set(at_x, at_y, number);
    }
    joins = true;
    last_x = at_x;
    last_y = at_y;
  }
}

}  // namespace

std::string TerminalPlot(const std::vector<TerminalCurve>& curves, const TerminalAxes& axes,
                         const TerminalStyle& style) {
  Span x;
  Span y;
  for (const TerminalCurve& curve : curves) {
    for (std::size_t i = 0; i < curve.x.size() && i < curve.y.size(); ++i) {
      if (!std::isfinite(curve.x[i]) || !std::isfinite(curve.y[i])) continue;
      x.Take(curve.x[i]);
      y.Take(curve.y[i]);
    }
  }
  if (!(x.to >= x.from)) return "";
  const int columns = std::max(style.columns, kLeastColumns);
  const int rows = std::clamp(axes.rows, 3, 100);
  const std::string top = Number(y.to);
  const std::string bottom = Number(y.from);
  const std::size_t margin = std::max(top.size(), bottom.size());
  const int wide = std::max(columns - static_cast<int>(margin) - 1, 4);
  Canvas canvas(wide, rows, style);
  for (std::size_t i = 0; i < curves.size(); ++i) {
    Draw(curves[i], static_cast<int>(i), x, y, canvas);
  }
  std::string text = Cut(axes.y, columns) + "\n";
  const char* const edge = style.utf8 ? "\u2502" : "|";
  for (int row = 0; row < rows; ++row) {
    const std::string label = row == 0 ? top : row + 1 == rows ? bottom : "";
    absl::StrAppend(&text, Padded(label, margin), edge, canvas.Row(row), "\n");
  }
  const std::string left = Number(x.from);
  const std::string right = Number(x.to);
  const int between = wide - static_cast<int>(left.size() + right.size());
  std::string middle = between > 2 ? Cut(axes.x, between - 2) : "";
  const int blanks = std::max(between - static_cast<int>(Cut(middle, 1000).size()), 1);
  absl::StrAppend(&text, std::string(margin + 1, ' '), left,
                  std::string(static_cast<std::size_t>(blanks / 2), ' '), middle,
                  std::string(static_cast<std::size_t>(blanks - blanks / 2), ' '), right, "\n");
  if (curves.size() < 2) return text;
  int used = 0;
  for (std::size_t i = 0; i < curves.size(); ++i) {
    const std::string name = Cut(curves[i].name, columns - 4);
    const int needs = static_cast<int>(name.size()) + 4;
    if (used > 0 && used + needs > columns) {
      text += "\n";
      used = 0;
    }
    absl::StrAppend(&text, used > 0 ? "  " : "", canvas.Sample(static_cast<int>(i)), " ", name);
    used += needs;
  }
  return text + "\n";
}

}  // namespace calib::report
