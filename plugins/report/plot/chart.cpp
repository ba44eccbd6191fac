// SPDX-License-Identifier: BSD-3-Clause
#include "chart.hpp"

#include <algorithm>
#include <cmath>

namespace cairn::plot {
namespace {

constexpr double kMargin = 16;
constexpr double kTickLength = 4;

}  // namespace

Box draw_heading(Canvas& canvas, const Theme& theme, const Box& box, const std::string& title,
                 const std::vector<LegendEntry>& legend) {
  double y = box.y + kTitleSize;
  canvas.text(box.x, y, title, kTitleSize, theme.ink, Align::left, true, box.width);
  double x = box.x;
  constexpr double kSample = 26, kGap = 18, kRow = 17;
  if (!legend.empty()) y += kRow + 2;
  for (const LegendEntry& entry : legend) {
    const double most = std::min(box.width - kSample - 8, 420.0);
    const double width = kSample + 6 + std::min(canvas.text_width(entry.name, kTextSize), most);
    if (x > box.x && x + width > box.right()) {
      x = box.x;
      y += kRow;
    }
    canvas.line(x, y - 4, x + kSample, y - 4, entry.stroke);
    canvas.text(x + kSample + 6, y, entry.name, kTextSize, theme.ink, Align::left, false, most);
    x += width + kGap;
  }
  const double used = y + 12 - box.y;
  return {box.x, box.y + used, box.width, box.height - used};
}

Chart::Chart(Canvas& canvas, const Theme& theme, const Box& box, const Range& x, const Range& y,
             const std::string& x_label, const std::string& y_label)
    : x_(x), y_(y) {
  const std::vector<double> y_ticks = y.ticks(std::max(2, static_cast<int>(box.height / 60)));
  double label_width = 0;
  for (const double tick : y_ticks) {
    label_width = std::max(label_width, canvas.text_width(tick_text(tick), kTextSize));
  }
  const double left = label_width + kTextSize + 18;
  area_ = {box.x + left, box.y, box.width - left - 8, box.height - 2 * kTextSize - 18};
  const std::vector<double> x_ticks = x.ticks(std::max(2, static_cast<int>(area_.width / 90)));
  const Stroke grid{theme.grid, 1, {}};
  for (const double tick : y_ticks) {
    canvas.line(area_.x - kTickLength, Chart::y(tick), area_.right(), Chart::y(tick), grid);
    canvas.text(area_.x - kTickLength - 4, Chart::y(tick) + 4, tick_text(tick), kTextSize,
                theme.muted, Align::right);
  }
  for (const double tick : x_ticks) {
    canvas.line(Chart::x(tick), area_.y, Chart::x(tick), area_.bottom() + kTickLength, grid);
    canvas.text(Chart::x(tick), area_.bottom() + kTextSize + 7, tick_text(tick), kTextSize,
                theme.muted, Align::centre);
  }
  canvas.text(area_.x + area_.width / 2, area_.bottom() + 2 * kTextSize + 12, x_label, kTextSize,
              theme.ink, Align::centre);
  canvas.text_upwards(box.x + kTextSize, area_.y + area_.height / 2, y_label, kTextSize, theme.ink);
}

void equalise(Bounds& bounds, const Box& box) {
  const double room = 0.03 * std::max(bounds.size(), 1e-6);
  const double width = bounds.x1 - bounds.x0 + 2 * room;
  const double height = bounds.y1 - bounds.y0 + 2 * room;
  const double metres = std::max(width / box.width, height / box.height);
  const double x = (bounds.x0 + bounds.x1) / 2, y = (bounds.y0 + bounds.y1) / 2;
  bounds = {x - metres * box.width / 2, x + metres * box.width / 2, y - metres * box.height / 2,
            y + metres * box.height / 2};
}

Chart plane(Canvas& canvas, const Theme& theme, const Box& box, Bounds& bounds) {
  // Room for the axes' texts, which depend little on the numbers.
  equalise(bounds, {0, 0, box.width - 70, box.height - 40});
  return {canvas,  theme,  box, {bounds.x0, bounds.x1, false}, {bounds.y0, bounds.y1, false},
          "x [m]", "y [m]"};
}

std::vector<Box> panels(const Canvas& canvas, std::size_t count, std::size_t columns) {
  if (columns == 0) {
    columns = static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(count))));
  }
  const std::size_t rows = (count + columns - 1) / columns;
  const double width = (canvas.width() - kMargin * double(columns + 1)) / double(columns);
  const double height = (canvas.height() - kMargin * double(rows + 1)) / double(rows);
  std::vector<Box> boxes;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t row = k / columns;
    boxes.push_back({kMargin + double(k % columns) * (width + kMargin),
                     kMargin + double(row) * (height + kMargin), width, height});
  }
  return boxes;
}

}  // namespace cairn::plot
