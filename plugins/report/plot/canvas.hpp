// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <cairo.h>

namespace cairn::plot {

struct Colour {
  double r = 0, g = 0, b = 0, alpha = 1;
};
/// 0xRRGGBB
Colour colour(unsigned rgb, double alpha = 1);
/// (1 - part) a + part b
Colour mix(const Colour& a, const Colour& b, double part);

/// How a line looks; dashes are on, off, … in pixels.
struct Stroke {
  Colour colour;
  double width = 1;
  std::vector<double> dash{};
};

/// The colours of docs/report.md.
struct Theme {
  Colour paper, ink, muted, grid;
  Stroke initial, estimate, truth, loop, landmark;
  std::vector<Stroke> peers;  ///< in turn
  std::vector<Colour> ramp;   ///< residuals, from least to worst
  const Stroke& peer(std::size_t k) const { return peers[k % peers.size()]; }
  Colour residual(double part) const;
};
Theme theme(std::string_view name);

struct Box {
  double x = 0, y = 0, width = 0, height = 0;
  double right() const { return x + width; }
  double bottom() const { return y + height; }
};

enum class Align { left, centre, right };

/// A page of pixels (in a PDF, 1/96 inch) that shapes and texts go onto.
class Canvas {
 public:
  /// `format`: svg, png or pdf.
  Canvas(std::string_view format, int width, int height, const Colour& paper);
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  int width() const { return width_; }
  int height() const { return height_; }

  // A path of lines, then what to do with it.
  void move_to(double x, double y) { cairo_move_to(context_.get(), x, y); }
  void line_to(double x, double y) { cairo_line_to(context_.get(), x, y); }
  void rectangle(const Box& box) {
    cairo_rectangle(context_.get(), box.x, box.y, box.width, box.height);
  }
  void dot(double x, double y, double radius);
  void stroke(const Stroke& stroke);
  void fill(const Colour& colour);
  void line(double x0, double y0, double x1, double y1, const Stroke& how);

  /// Cells of a grid, whose colours are asked for by number, row by row: the first one has a corner
  /// at `origin`, from which `column` is one column and `row` one row away (each x and y). Throws
  /// `Error` (input) for more than 32767 rows or columns.
  void image(const std::function<Colour(std::size_t)>& cells, int columns, int rows,
             const std::array<double, 2>& origin, const std::array<double, 2>& column,
             const std::array<double, 2>& row);

  /// Whatever is drawn until `unclip` stays within the box.
  void clip(const Box& box);
  void unclip() { cairo_restore(context_.get()); }

  /// `y` is the base line. Text that is not UTF-8, or has line ends, is made printable; with
  /// `most` > 0 what is wider ends in an ellipsis.
  void text(double x, double y, std::string_view text, double size, const Colour& colour,
            Align align = Align::left, bool bold = false, double most = 0);
  void text_upwards(double x, double y, std::string_view text, double size, const Colour& colour);
  double text_width(std::string_view text, double size, bool bold = false);

  /// The file. Throws `Error` (input) if drawing failed (a plot too large).
  std::string finish();

 private:
  struct Release {
    void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
    void operator()(cairo_t* context) const { cairo_destroy(context); }
  };
  void font(double size, bool bold);
  void check() const;

  std::string format_;
  std::string bytes_;  // before the surface, which writes into it until it is destroyed
  int width_, height_;
  std::unique_ptr<cairo_surface_t, Release> surface_;
  std::unique_ptr<cairo_t, Release> context_;
};

}  // namespace cairn::plot
