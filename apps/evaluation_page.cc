#include "evaluation_page.h"

#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>
#include <string_view>

#include "evaluation_table.h"
#include "svg_plot.h"

namespace monoperfcap {
namespace {

constexpr const char* kHead = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Evaluation</title>
<style>
body { font: 15px/1.5 system-ui, sans-serif; color: #222; background: #fff; max-width: 1000px;
       margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.5em; margin-bottom: 0; } h2 { font-size: 1.15em; margin: 2em 0 .4em; }
table { border-collapse: collapse; width: 100%; font-size: 14px; }
th, td { text-align: left; padding: .25em .8em .25em 0; border-bottom: 1px solid #e4e4e4; }
td.number { text-align: right; font-variant-numeric: tabular-nums; font-weight: 600; }
svg { width: 100%; height: auto; display: block; } svg text { font-size: 12px; fill: #444; }
.grid { stroke: #e4e4e4; } .line { fill: none; stroke-width: 1.8; stroke-linecap: round;
        stroke-linejoin: round; }
.note { color: #666; font-size: 14px; margin: .2em 0; overflow-wrap: anywhere; }
.frames { display: grid; grid-template-columns: repeat(auto-fill, minmax(220px, 1fr)); gap: 14px; }
figure { margin: 0; } figure img { width: 100%; } figcaption { font-size: 13px; color: #444; }
.captured { background: #222; color: #ffdc00; padding: 0 .4em; }
.true { background: #222; color: #ff50ff; padding: 0 .4em; }
</style></head><body>
)";

std::string Base64(const std::vector<unsigned char>& bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    unsigned block = static_cast<unsigned>(bytes[i]) << 16;
    if (i + 1 < bytes.size()) block |= static_cast<unsigned>(bytes[i + 1]) << 8;
    if (i + 2 < bytes.size()) block |= bytes[i + 2];
    text += kDigits[block >> 18];
    text += kDigits[(block >> 12) & 63];
    text += i + 1 < bytes.size() ? kDigits[(block >> 6) & 63] : '=';
    text += i + 2 < bytes.size() ? kDigits[block & 63] : '=';
  }
  return text;
}

std::string Heading(const Evaluation& evaluation) {
  return fmt::format(
      "<h1>{}</h1>\n<p class=\"note\">against {}; {} frames, {:.4g} frames per second</p>\n",
      EscapeHtml(evaluation.estimate), EscapeHtml(evaluation.truth), evaluation.num_frames(),
      evaluation.fps);
}

std::string Table(const Evaluation& evaluation) {
  std::string html =
      "<table><tr><th>metric</th><th></th><th></th><th>scored</th><th>aligned</th>"
      "<th>frames</th></tr>\n";
  for (const Score& score : Scores(evaluation)) {
    html += fmt::format(
        "<tr><td>{}</td><td class=\"number\">{}</td><td>{}</td><td>{}</td><td>{}</td>"
        "<td>{} of {}</td></tr>\n",
        score.label, ValueText(score), score.unit, EscapeHtml(score.scored), score.alignment,
        score.num_frames, evaluation.num_frames());
  }
  html += "</table>\n";
  for (const std::string& part : evaluation.skipped) {
    html += fmt::format("<p class=\"note\">Skipped: {}.</p>\n", EscapeHtml(part));
  }
  return html;
}

std::string Section(const std::string& title, const std::string& content) {
  return content.empty() ? "" : fmt::format("<h2>{}</h2>\n{}", title, content);
}

std::string MaskPlot(const Evaluation& evaluation) {
  std::vector<PlotLine> lines;
  if (evaluation.model) {
    lines.push_back({"mesh", evaluation.model->iou});
    lines.push_back({"mesh, boundary F", evaluation.model->boundary_f});
  }
  if (evaluation.silhouettes) {
    lines.push_back({"silhouettes", evaluation.silhouettes->iou});
    lines.push_back({"silhouettes, boundary F", evaluation.silhouettes->boundary_f});
  }
  return LinePlot("", lines, 0.5);
}

std::string Plots(const Evaluation& evaluation) {
  const mpc::JointErrors& errors = evaluation.errors;
  const std::string joints = fmt::format("{} joints", evaluation.joints.size());
  std::vector<std::string> names;
  std::vector<PlotBar> bars;
  for (size_t i = 0; i < errors.joints.size(); ++i) {
    names.emplace_back(mpc::JointName(errors.joints[i]));
    bars.push_back({names.back(), errors.root.per_joint_mm[static_cast<Eigen::Index>(i)]});
  }
  std::string html = Section("Joint error, " + joints,
                             LinePlot("mm", {{"MPJPE", errors.root.per_frame_mm},
                                             {"PA-MPJPE", errors.similarity.per_frame_mm}}));
  html += Section("Error per joint over time, aligned: root translation",
                  HeatMap("mm", names, errors.root.each_mm));
  html += Section("Error per joint, mean, aligned: root translation", BarPlot("mm", bars));
  html +=
      Section("Root error, nothing aligned", LinePlot("mm", {{"root", errors.place.per_frame_mm}}));
  if (evaluation.surface) {
    std::vector<PlotLine> lines = {{"same vertex", evaluation.surface->vertex_mm}};
    if (evaluation.surface->surface_mm.size() > 0) {
      lines.push_back({"surface to surface", evaluation.surface->surface_mm});
    }
    html += Section("Surface error, aligned: one translation of the clip", LinePlot("mm", lines));
  }
  html += Section("IoU and boundary F with the true masks", MaskPlot(evaluation));
  if (evaluation.skate) {
    html += Section("Foot skate while the true foot stands",
                    LinePlot("mm/frame", {{"ankles and toes", evaluation.skate->per_frame_mm}}));
  }
  return html;
}

std::string Pictures(const std::vector<FramePicture>& pictures) {
  if (pictures.empty()) return "";
  std::string html =
      "<p class=\"note\"><span class=\"captured\">captured</span> and "
      "<span class=\"true\">true</span> outline or stick figure.</p>\n<div class=\"frames\">\n";
  for (const FramePicture& picture : pictures) {
    std::vector<unsigned char> jpeg;
    cv::imencode(".jpg", picture.bgr, jpeg, {cv::IMWRITE_JPEG_QUALITY, 88});
    html += fmt::format(
        "<figure><img alt=\"{0}\" src=\"data:image/jpeg;base64,{1}\">"
        "<figcaption>{0}</figcaption></figure>\n",
        EscapeHtml(picture.caption), Base64(jpeg));
  }
  return html + "</div>\n";
}

}  // namespace

std::string EvaluationPage(const Evaluation& evaluation,
                           const std::vector<FramePicture>& pictures) {
  return kHead + Heading(evaluation) + Section("Metrics", Table(evaluation)) +
         Section("Worst frames", Pictures(pictures)) + Plots(evaluation) + "</body></html>\n";
}

}  // namespace monoperfcap
