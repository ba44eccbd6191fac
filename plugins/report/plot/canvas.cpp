// SPDX-License-Identifier: BSD-3-Clause
#include "canvas.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <new>
#include <numbers>

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <fmt/core.h>

#include "cairn/io/packed_array.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::plot {
namespace {

constexpr double kPointsAPixel = 0.75;  // 72 points, 96 pixels an inch

cairo_status_t append(void* closure, const unsigned char* data, unsigned length) noexcept {
  try {
    static_cast<std::string*>(closure)->append(reinterpret_cast<const char*>(data), length);
  } catch (const std::bad_alloc&) {
    return CAIRO_STATUS_NO_MEMORY;
  }
  return CAIRO_STATUS_SUCCESS;
}

cairo_surface_t* make_surface(std::string_view format, std::string& bytes, int width, int height) {
  if (format == "svg") {
    return cairo_svg_surface_create_for_stream(append, &bytes, width * kPointsAPixel,
                                               height * kPointsAPixel);
  }
  if (format == "pdf") {
    return cairo_pdf_surface_create_for_stream(append, &bytes, width * kPointsAPixel,
                                               height * kPointsAPixel);
  }
  return cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height);
}

/// Names come from files: anything may stand in them.
std::string printable(std::string_view text) {
  std::string result = valid_utf8(text);
  for (char& c : result) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  }
  return result;
}

/// Without its last character.
void shorten(std::string& text) {
  while (!text.empty() && (static_cast<unsigned char>(text.back()) & 0xc0U) == 0x80U) {
    text.pop_back();
  }
  if (!text.empty()) text.pop_back();
}

}  // namespace

Colour colour(unsigned rgb, double alpha) {
  return {(rgb >> 16 & 255U) / 255.0, (rgb >> 8 & 255U) / 255.0, (rgb & 255U) / 255.0, alpha};
}

Colour mix(const Colour& a, const Colour& b, double part) {
  const auto between = [part](double x, double y) { return x + part * (y - x); };
  return {between(a.r, b.r), between(a.g, b.g), between(a.b, b.b), between(a.alpha, b.alpha)};
}

Colour Theme::residual(double part) const {
  const double place = std::clamp(part, 0.0, 1.0) * static_cast<double>(ramp.size() - 1);
  const std::size_t k = std::min(static_cast<std::size_t>(place), ramp.size() - 2);
  return mix(ramp[k], ramp[k + 1], place - static_cast<double>(k));
}

Theme theme(std::string_view name) {
  const bool dark = name == "dark";
  const auto pick = [dark](unsigned on_light, unsigned on_dark, double alpha = 1) {
    return colour(dark ? on_dark : on_light, alpha);
  };
  Theme t;
  t.paper = pick(0xfcfcfb, 0x14171b);
  t.ink = pick(0x1a1d21, 0xe8eaed);
  t.muted = pick(0x5c636d, 0xa3aab4);
  t.grid = pick(0xe4e5e3, 0x262b31);
  t.initial = {pick(0x8a8f98, 0x8a919c), 1, {1, 2}};
  t.estimate = {pick(0x0072b2, 0x56b4e9), 2, {}};
  t.truth = {pick(0x1a1d21, 0xf2f4f7), 1, {6, 4}};
  t.loop = {pick(0xe69f00, 0xe69f00, 0.55), 1, {}};
  t.landmark = {pick(0x009e73, 0x2fc79a, 0.45), 0.75, {}};
  t.peers = {{pick(0xd55e00, 0xff8a3d), 1.5, {6, 3}},
             {pick(0x009e73, 0x2fc79a), 1.5, {2, 2}},
             {pick(0xcc79a7, 0xe6a3c8), 1.5, {8, 3, 2, 3}},
             {pick(0x56b4e9, 0x9ad4f5), 1.5, {12, 4}},
             {pick(0xb8860b, 0xe0b83c), 1.5, {4, 2, 1, 2}}};
  t.ramp = {pick(0xd5d8dc, 0x3a424d), pick(0xf0c987, 0x7a4a5e), pick(0xe58a2c, 0xc2552f),
            pick(0xb8430e, 0xf09a2e), pick(0x5c0a12, 0xffe9a8)};
  return t;
}

Canvas::Canvas(std::string_view format, int width, int height, const Colour& paper)
    : format_(format),
      width_(width),
      height_(height),
      surface_(make_surface(format, bytes_, width, height)),
      context_(cairo_create(surface_.get())) {
  if (format_ != "png") cairo_scale(context_.get(), kPointsAPixel, kPointsAPixel);
  cairo_set_line_join(context_.get(), CAIRO_LINE_JOIN_ROUND);
  rectangle({0, 0, double(width), double(height)});
  fill(paper);
}

void Canvas::dot(double x, double y, double radius) {
  cairo_new_sub_path(context_.get());
  cairo_arc(context_.get(), x, y, radius, 0, 2 * std::numbers::pi);
  cairo_close_path(context_.get());
}

void Canvas::stroke(const Stroke& how) {
  const Colour& c = how.colour;
  cairo_set_source_rgba(context_.get(), c.r, c.g, c.b, c.alpha);
  cairo_set_line_width(context_.get(), how.width);
  cairo_set_dash(context_.get(), how.dash.data(), static_cast<int>(how.dash.size()), 0);
  cairo_stroke(context_.get());
}

void Canvas::fill(const Colour& c) {
  cairo_set_source_rgba(context_.get(), c.r, c.g, c.b, c.alpha);
  cairo_fill(context_.get());
}

void Canvas::line(double x0, double y0, double x1, double y1, const Stroke& how) {
  move_to(x0, y0);
  line_to(x1, y1);
  stroke(how);
}

void Canvas::image(const std::function<Colour(std::size_t)>& cells, int columns, int rows,
                   const std::array<double, 2>& origin, const std::array<double, 2>& column,
                   const std::array<double, 2>& row) {
  const std::unique_ptr<cairo_surface_t, Release> image(
      cairo_image_surface_create(CAIRO_FORMAT_RGB24, columns, rows));
  if (cairo_surface_status(image.get()) != CAIRO_STATUS_SUCCESS)
    throw Error(ErrorCode::input,
                fmt::format("a map of {} x {} cells is too large to draw", columns, rows));
  unsigned char* const bytes = cairo_image_surface_get_data(image.get());
  const auto stride = static_cast<std::size_t>(cairo_image_surface_get_stride(image.get()));
  const auto to_byte = [](double part) {
    return static_cast<std::uint32_t>(std::lround(255.0 * std::clamp(part, 0.0, 1.0)));
  };
  std::size_t cell = 0;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      const Colour c = cells(cell++);
      const std::uint32_t pixel = to_byte(c.r) << 16 | to_byte(c.g) << 8 | to_byte(c.b);
      std::memcpy(bytes + static_cast<std::size_t>(y) * stride + 4 * static_cast<std::size_t>(x),
                  &pixel, sizeof pixel);
    }
  }
  cairo_surface_mark_dirty(image.get());
  cairo_save(context_.get());
  cairo_matrix_t matrix;
  cairo_matrix_init(&matrix, column[0] - origin[0], column[1] - origin[1], row[0] - origin[0],
                    row[1] - origin[1], origin[0], origin[1]);
  cairo_transform(context_.get(), &matrix);
  cairo_set_source_surface(context_.get(), image.get(), 0, 0);
  cairo_pattern_set_filter(cairo_get_source(context_.get()), CAIRO_FILTER_NEAREST);
  rectangle({0, 0, double(columns), double(rows)});
  cairo_fill(context_.get());
  cairo_restore(context_.get());
}

void Canvas::clip(const Box& box) {
  cairo_save(context_.get());
  rectangle(box);
  cairo_clip(context_.get());
}

void Canvas::font(double size, bool bold) {
  cairo_select_font_face(context_.get(), "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                         bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context_.get(), size);
}

double Canvas::text_width(std::string_view text, double size, bool bold) {
  font(size, bold);
  cairo_text_extents_t extents;
  cairo_text_extents(context_.get(), printable(text).c_str(), &extents);
  return extents.x_advance;
}

void Canvas::text(double x, double y, std::string_view text, double size, const Colour& c,
                  Align align, bool bold, double most) {
  std::string shown = printable(text);
  double width = text_width(shown, size, bold);
  while (most > 0 && width > most && shown.size() > 3) {
    if (shown.ends_with("…")) shorten(shown);
    shorten(shown);
    shown += "…";
    width = text_width(shown, size, bold);
  }
  const double shift = align == Align::left ? 0 : align == Align::centre ? width / 2 : width;
  cairo_set_source_rgba(context_.get(), c.r, c.g, c.b, c.alpha);
  cairo_move_to(context_.get(), x - shift, y);
  cairo_show_text(context_.get(), shown.c_str());
  cairo_new_path(context_.get());
}

void Canvas::text_upwards(double x, double y, std::string_view text, double size, const Colour& c) {
  const double width = text_width(text, size);
  cairo_save(context_.get());
  cairo_set_source_rgba(context_.get(), c.r, c.g, c.b, c.alpha);
  cairo_translate(context_.get(), x, y + width / 2);
  cairo_rotate(context_.get(), -std::numbers::pi / 2);
  cairo_move_to(context_.get(), 0, 0);
  cairo_show_text(context_.get(), printable(text).c_str());
  cairo_new_path(context_.get());
  cairo_restore(context_.get());
}

void Canvas::check() const {
  cairo_status_t status = cairo_status(context_.get());
  if (status == CAIRO_STATUS_SUCCESS) status = cairo_surface_status(surface_.get());
  if (status == CAIRO_STATUS_SUCCESS) return;
  if (status == CAIRO_STATUS_NO_MEMORY) throw std::bad_alloc();
  throw Error(ErrorCode::input, fmt::format("the plot of {} x {} pixels could not be drawn: {}",
                                            width_, height_, cairo_status_to_string(status)));
}

std::string Canvas::finish() {
  cairo_surface_flush(surface_.get());
  check();
  if (format_ == "png") {
    const cairo_status_t written =
        cairo_surface_write_to_png_stream(surface_.get(), append, &bytes_);
    if (written != CAIRO_STATUS_SUCCESS) throw std::bad_alloc();  // nothing else can go wrong
  } else {
    cairo_surface_finish(surface_.get());
  }
  const cairo_status_t status = cairo_surface_status(surface_.get());
  if (status != CAIRO_STATUS_SUCCESS && status != CAIRO_STATUS_SURFACE_FINISHED) check();
  return std::move(bytes_);
}

}  // namespace cairn::plot
