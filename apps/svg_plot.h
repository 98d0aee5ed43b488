// Purpose: plots as SVG text, to stand in an HTML page on their own.
// Symbols: F frames.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace monoperfcap {

// One line of a plot: a value per frame, NaN where there is none.
struct PlotLine {
  std::string name;
  Eigen::VectorXd values;  // F
};

// Lines over the frames, with a grid, a legend and the unit at the axis; empty without a finite
// value. The axis starts at 0 unless all values lie above `floor`.
std::string LinePlot(const std::string& unit, const std::vector<PlotLine>& lines, double floor = 0);

struct PlotBar {
  std::string name;
  double value = 0;
};

// Horizontal bars with their values.
std::string BarPlot(const std::string& unit, const std::vector<PlotBar>& bars);

// A row of cells per name (rows of `values`), light for 0 and dark for `highest`; blank for NaN.
std::string HeatMap(const std::string& unit, const std::vector<std::string>& names,
                    const Eigen::MatrixXd& values);

// Text with the characters that mean something in HTML replaced.
std::string EscapeHtml(const std::string& text);

}  // namespace monoperfcap
