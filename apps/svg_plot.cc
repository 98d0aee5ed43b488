#include "svg_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace monoperfcap {
namespace {

using Eigen::Index;

constexpr double kWidth = 900;  // of every plot, in its own units
constexpr double kLeft = 64;    // room for the axis
constexpr double kRight = 16;
// Colours that colour-blind people can tell apart (Okabe and Ito 2008).
constexpr std::array kColours = {"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"};

std::string Open(double height) {
  return fmt::format("<svg viewBox=\"0 0 {} {}\" role=\"img\">\n", kWidth, height);
}

std::string Text(double x, double y, const char* anchor, const std::string& text) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", x, y, anchor,
                     EscapeHtml(text));
}

std::string Line(double x0, double y0, double x1, double y1) {
  return fmt::format(
      "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" class=\"grid\"/>\n", x0, y0,
      x1, y1);
}

// A round step that divides a range into four to ten parts.
double TickStep(double range) {
  const double power = std::pow(10, std::floor(std::log10(range)));
  for (const double factor : {0.1, 0.2, 0.5, 1.0}) {
    if (range / (factor * power) <= 10) return factor * power;
  }
  return power;
}

// Where values and frames are on the page.
struct Axes {
  double low = 0;
  double high = 1;
  Index num_frames = 1;
  double top = 14;
  double bottom = 240;

  double X(double frame) const {
    return kLeft + frame * (kWidth - kLeft - kRight) / std::max<double>(1, num_frames - 1.0);
  }
  double Y(double value) const { return bottom - (value - low) / (high - low) * (bottom - top); }

  std::string Grid(const std::string& unit) const {
    std::string svg;
    const double step = TickStep(high - low);
    for (double tick = std::ceil(low / step) * step; tick <= high + 1e-9 * step; tick += step) {
      svg += Line(kLeft, Y(tick), kWidth - kRight, Y(tick));
      svg += Text(kLeft - 6, Y(tick) + 4, "end", fmt::format("{:.6g}", tick + 0.0));
    }
    if (!unit.empty()) svg += Text(kLeft - 6, top - 2, "end", unit);
    return svg + FrameTicks();
  }

  std::string FrameTicks() const {
    std::string svg;
    const double step = std::max(1.0, TickStep(std::max<double>(1, num_frames - 1.0)));
    for (double frame = 0; frame < static_cast<double>(num_frames); frame += step) {
      svg += Text(X(frame), bottom + 17, "middle", fmt::format("{:.0f}", frame));
    }
    return svg + Text(kWidth - kRight, bottom + 34, "end", "frame");
  }
};

// A path through the finite values; a value alone becomes a dot.
std::string Path(const Axes& axes, const Eigen::VectorXd& values, const char* colour) {
  std::string path;
  for (Index f = 0; f < values.size(); ++f) {
    if (!std::isfinite(values[f])) continue;
    const bool goes_on = f > 0 && std::isfinite(values[f - 1]);
    const double x = axes.X(static_cast<double>(f)), y = axes.Y(values[f]);
    path += fmt::format("{}{:.1f} {:.1f}", goes_on ? 'L' : 'M', x, y);
    if (!goes_on) path += "h0";
  }
  return fmt::format("<path d=\"{}\" stroke=\"{}\" class=\"line\"/>\n", path, colour);
}

double HighestFinite(const Eigen::MatrixXd& values) {
  double highest = -std::numeric_limits<double>::infinity();
  for (const double value : values.reshaped()) {
    if (std::isfinite(value)) highest = std::max(highest, value);
  }
  return highest;
}

}  // namespace

std::string LinePlot(const std::string& unit, const std::vector<PlotLine>& lines, double floor) {
  double highest = -std::numeric_limits<double>::infinity();
  double lowest = -highest;
  for (const PlotLine& line : lines) {
    highest = std::max(highest, HighestFinite(line.values));
    lowest = std::min(lowest, -HighestFinite(-line.values));
  }
  if (!std::isfinite(highest)) return "";
  Axes axes{.low = lowest > floor ? floor : std::min(0.0, lowest), .num_frames = 1};
  axes.high = highest > axes.low ? highest : axes.low + 1;
  for (const PlotLine& line : lines)
    axes.num_frames = std::max(axes.num_frames, line.values.size());
  std::string svg = Open(axes.bottom + 44) + axes.Grid(unit);
  double x = kLeft;
  for (size_t i = 0; i < lines.size(); ++i) {
    const char* colour = kColours[i % kColours.size()];
    svg += Path(axes, lines[i].values, colour);
    svg += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"14\" height=\"4\" fill=\"{}\"/>\n",
                       x, axes.bottom + 28, colour);
    svg += Text(x + 19, axes.bottom + 34, "start", lines[i].name);
    x += 40 + 7.5 * static_cast<double>(lines[i].name.size());
  }
  return svg + "</svg>\n";
}

std::string BarPlot(const std::string& unit, const std::vector<PlotBar>& bars) {
  constexpr double kNames = 130, kRow = 22;
  double highest = 0;
  for (const PlotBar& bar : bars) {
    if (std::isfinite(bar.value)) highest = std::max(highest, bar.value);
  }
  std::string svg = Open(kRow * static_cast<double>(bars.size()) + 6);
  for (size_t i = 0; i < bars.size(); ++i) {
    const double y = kRow * static_cast<double>(i) + 4;
    svg += Text(kNames - 8, y + 13, "end", bars[i].name);
    if (!std::isfinite(bars[i].value)) continue;
    const double width = highest > 0 ? bars[i].value / highest * (kWidth - kNames - 110) : 0;
    svg += fmt::format("<rect x=\"{}\" y=\"{}\" width=\"{:.1f}\" height=\"16\" fill=\"{}\"/>\n",
                       kNames, y, width, kColours[0]);
    svg += Text(kNames + width + 6, y + 13, "start", fmt::format("{:.1f} {}", bars[i].value, unit));
  }
  return svg + "</svg>\n";
}

std::string HeatMap(const std::string& unit, const std::vector<std::string>& names,
                    const Eigen::MatrixXd& values) {
  constexpr double kNames = 130, kRow = 18;
  constexpr Index kMaxCells = 300;  // per row
  const double highest = HighestFinite(values);
  if (!std::isfinite(highest)) return "";
  const Index stride = (values.cols() + kMaxCells - 1) / kMaxCells;  // frames of a cell
  const Index num_cells = (values.cols() + stride - 1) / stride;
  const double cell = (kWidth - kNames - kRight) / static_cast<double>(num_cells);
  const double bottom = kRow * static_cast<double>(values.rows());
  std::string svg = Open(bottom + 24);
  for (Index row = 0; row < values.rows(); ++row) {
    const double y = kRow * static_cast<double>(row);
    svg += Text(kNames - 8, y + 13, "end", names[static_cast<size_t>(row)]);
    for (Index c = 0; c < num_cells; ++c) {
      const Index begin = c * stride, count = std::min(stride, values.cols() - begin);
      const double worst = HighestFinite(values.row(row).segment(begin, count));
      if (!std::isfinite(worst)) continue;
      const double share = highest > 0 ? worst / highest : 0;
      // From nearly white over orange to dark red.
      svg += fmt::format(
          "<rect x=\"{:.2f}\" y=\"{:.1f}\" width=\"{:.2f}\" height=\"{}\" "
          "fill=\"rgb({:.0f},{:.0f},{:.0f})\"/>",
          kNames + cell * static_cast<double>(c), y, cell + 0.3, kRow - 1,
          255 - 115 * share * share, 245 - 235 * std::min(1.0, 1.1 * share),
          230 - 210 * std::min(1.0, 1.6 * share));
    }
    svg += '\n';
  }
  svg += Text(kNames, bottom + 18, "start",
              fmt::format("white: 0, dark red: {:.0f} {}; left to right: frames 0 to {}", highest,
                          unit, values.cols() - 1));
  return svg + "</svg>\n";
}

std::string EscapeHtml(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

}  // namespace monoperfcap
