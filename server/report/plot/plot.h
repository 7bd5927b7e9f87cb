#pragma once
// Curves, bands and points on two axes as inline SVG, styled by the classes of the page (html.cc).

#include <span>
#include <string>
#include <vector>

#include "server/report/plot/axis.h"

namespace calib::report {

struct PlotSize {
  double width = 520;
  double height = 300;
  double left = 62;  ///< margins that hold tick labels and axis names
  double bottom = 44;
  double top = 10;
  double right = 12;
};

class Plot {
 public:
  Plot(PlotSize size, Axis x, Axis y);

  // All of these skip values that are not finite and cut off at the frame. css: class names of the
  // page's style.
  void AddBand(std::span<const double> x, std::span<const double> low, std::span<const double> high,
               const std::string& css = "band");
  void AddLine(std::span<const double> x, std::span<const double> y,
               const std::string& css = "mean");
  void AddPoints(std::span<const double> x, std::span<const double> y, double radius,
                 const std::string& css = "point");
  /// Points with areas in proportion to `weights`, the largest of radius `largest`.
  void AddWeightedPoints(std::span<const double> x, std::span<const double> y,
                         std::span<const double> weights, double largest,
                         const std::string& css = "sample");
  void AddErrorBars(std::span<const double> x, std::span<const double> y,
                    std::span<const double> sd, const std::string& css = "error");
  /// Columns of a histogram whose bins are edges[i] .. edges[i + 1].
  void AddColumns(std::span<const double> edges, std::span<const double> heights,
                  const std::string& css = "posterior");
  void AddHorizontal(double y, const std::string& css = "zero");
  /// Leaves out tick labels and axis names (for small plots in a grid).
  void HideLabels(bool x, bool y);

  /// The whole picture; title and description are read aloud by screen readers and escaped here.
  std::string Svg(const std::string& title, const std::string& description) const;

 private:
  double X(double value) const;
  double Y(double value) const;
  std::string Frame() const;

  PlotSize size_;
  Axis x_;
  Axis y_;
  bool show_x_ = true;
  bool show_y_ = true;
  std::string marks_;
};

}  // namespace calib::report
