#include "server/report/plot/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

#include "server/report/text/html.h"

namespace calib::report {
namespace {

// Every picture has its own names for its clip path and its texts.
int NextId() {
  static std::atomic<int> next{0};
  return ++next;
}

}  // namespace

Plot::Plot(PlotSize size, Axis x, Axis y) : size_(size), x_(std::move(x)), y_(std::move(y)) {}

double Plot::X(double value) const {
  return size_.left + x_.Fraction(value) * (size_.width - size_.left - size_.right);
}

double Plot::Y(double value) const {
  return size_.height - size_.bottom -
         y_.Fraction(value) * (size_.height - size_.bottom - size_.top);
}

void Plot::AddBand(std::span<const double> x, std::span<const double> low,
                   std::span<const double> high, const std::string& css) {
  std::string there;
  std::string back;
  const auto close = [&] {
    if (!there.empty()) {
      marks_ += fmt::format("<polygon class=\"{}\" points=\"{}{}\"/>\n", css, there, back);
    }
    there.clear();
    back.clear();
  };
  const auto append = [&](std::size_t i) {
    there += fmt::format("{:.2f},{:.2f} ", X(x[i]), Y(high[i]));
    back = fmt::format("{:.2f},{:.2f} ", X(x[i]), Y(low[i])) + back;
  };
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!std::isfinite(x[i]) || !std::isfinite(low[i]) || !std::isfinite(high[i])) {
      close();
      continue;
    }
    // Where x turns back (unloading) a new piece begins, so that no piece folds over itself.
    const bool turns = i >= 2 && (x[i] - x[i - 1]) * (x[i - 1] - x[i - 2]) < 0;
    if (turns && !there.empty()) {
      close();
      append(i - 1);
    }
    append(i);
  }
  close();
}

void Plot::AddLine(std::span<const double> x, std::span<const double> y, const std::string& css) {
  std::string points;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (std::isfinite(x[i]) && std::isfinite(y[i])) {
      points += fmt::format("{:.2f},{:.2f} ", X(x[i]), Y(y[i]));
    }
  }
  marks_ += fmt::format("<polyline class=\"{}\" points=\"{}\"/>\n", css, points);
}

void Plot::AddPoints(std::span<const double> x, std::span<const double> y, double radius,
                     const std::string& css) {
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!std::isfinite(x[i]) || !std::isfinite(y[i])) continue;
    marks_ += fmt::format("<circle class=\"{}\" cx=\"{:.2f}\" cy=\"{:.2f}\" r=\"{:.2f}\"/>\n", css,
                          X(x[i]), Y(y[i]), radius);
  }
}

void Plot::AddWeightedPoints(std::span<const double> x, std::span<const double> y,
                             std::span<const double> weights, double largest,
                             const std::string& css) {
  double most = 0;
  for (const double weight : weights) most = std::max(most, weight);
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!std::isfinite(x[i]) || !std::isfinite(y[i]) || !(weights[i] > 0)) continue;
    const double radius = largest * std::sqrt(weights[i] / most);
    constexpr double kVisible = 0.3;
    if (radius < kVisible) continue;
    marks_ += fmt::format(
        "<circle class=\"{}\" fill-opacity=\"0.55\" cx=\"{:.2f}\" cy=\"{:.2f}\" r=\"{:.2f}\"/>\n",
        css, X(x[i]), Y(y[i]), radius);
  }
}

void Plot::AddErrorBars(std::span<const double> x, std::span<const double> y,
                        std::span<const double> sd, const std::string& css) {
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!std::isfinite(y[i]) || !std::isfinite(sd[i])) continue;
    marks_ += fmt::format("<path class=\"{}\" d=\"M{:.2f} {:.2f}V{:.2f}\"/>\n", css, X(x[i]),
                          Y(y[i] - sd[i]), Y(y[i] + sd[i]));
  }
}

void Plot::AddColumns(std::span<const double> edges, std::span<const double> heights,
                      const std::string& css) {
  for (std::size_t i = 0; i < heights.size(); ++i) {
    if (!(heights[i] > 0)) continue;
    const double left = X(edges[i]);
    const double top = Y(heights[i]);
    marks_ += fmt::format(
        "<rect class=\"{}\" x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"{:.2f}\"/>\n", css,
        left, top, X(edges[i + 1]) - left, Y(y_.min()) - top);
  }
}

void Plot::AddHorizontal(double y, const std::string& css) {
  marks_ += fmt::format("<path class=\"{}\" d=\"M{:.2f} {:.2f}H{:.2f}\"/>\n", css, size_.left, Y(y),
                        size_.width - size_.right);
}

void Plot::HideLabels(bool x, bool y) {
  show_x_ = !x;
  show_y_ = !y;
}

std::string Plot::Frame() const {
  const double right = size_.width - size_.right;
  const double floor = size_.height - size_.bottom;
  std::string svg;
  for (const Tick& tick : x_.ticks()) {
    const double at = X(tick.value);
    svg += fmt::format("<path class=\"gridline\" d=\"M{:.2f} {:.2f}V{:.2f}\"/>\n", at, size_.top,
                       floor);
    if (show_x_) {
      svg += fmt::format(
          "<text class=\"tick\" x=\"{:.2f}\" y=\"{:.2f}\" text-anchor=\"middle\">{}</text>\n", at,
          floor + 15, tick.label);
    }
  }
  for (const Tick& tick : y_.ticks()) {
    const double at = Y(tick.value);
    svg += fmt::format("<path class=\"gridline\" d=\"M{:.2f} {:.2f}H{:.2f}\"/>\n", size_.left, at,
                       right);
    if (show_y_) {
      svg += fmt::format(
          "<text class=\"tick\" x=\"{:.2f}\" y=\"{:.2f}\" text-anchor=\"end\">{}</text>\n",
          size_.left - 6, at + 4, tick.label);
    }
  }
  svg += fmt::format("<path class=\"axis\" d=\"M{:.2f} {:.2f}V{:.2f}H{:.2f}\"/>\n", size_.left,
                     size_.top, floor, right);
  if (show_x_) {
    svg += fmt::format("<text x=\"{:.2f}\" y=\"{:.2f}\" text-anchor=\"middle\">{}</text>\n",
                       0.5 * (size_.left + right), floor + 34, Escape(x_.label()));
  }
  if (show_y_) {
    svg += fmt::format(
        "<text transform=\"translate(14 {:.2f}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
        0.5 * (size_.top + floor), Escape(y_.label()));
  }
  return svg;
}

std::string Plot::Svg(const std::string& title, const std::string& description) const {
  const int id = NextId();
  return fmt::format(
             "<svg viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" role=\"img\" "
             "aria-labelledby=\"t{2} d{2}\">\n"
             "<title id=\"t{2}\">{3}</title>\n<desc id=\"d{2}\">{4}</desc>\n",
             size_.width, size_.height, id, Escape(title), Escape(description)) +
         fmt::format(
             "<clipPath id=\"c{}\"><rect x=\"{}\" y=\"{}\" width=\"{}\" "
             "height=\"{}\"/></clipPath>\n",
             id, size_.left - 4, size_.top - 4, size_.width - size_.left - size_.right + 8,
             size_.height - size_.top - size_.bottom + 8) +
         Frame() + fmt::format("<g clip-path=\"url(#c{})\">\n", id) + marks_ + "</g>\n</svg>\n";
}

}  // namespace calib::report
