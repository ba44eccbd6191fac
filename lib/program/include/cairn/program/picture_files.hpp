// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "cairn/plugin/registry.hpp"
#include "cairn/program/session.hpp"
#include "cairn/report/scene.hpp"

namespace cairn::app {

/// The name of a plot of `file` where none is given: "sphere.svg" for maps/sphere.g2o.gz
/// and the ending "svg", in the folder where the program runs; "cairn.svg" for what is not from a
/// file.
std::string default_picture(const std::string& file, const std::string& ending);

/// The name of kind picture that a file's ending asks for. Throws `Error` (usage) with the endings
/// on offer.
std::string picture_format(const std::string& file, Session& session);

/// Throws `Error` (plugin) where nothing makes pages for the browser, with what to do instead, or
/// with where plugins were looked for if none was found at all.
void check_makes_pages(const std::string& remedy, Session& session);

/// Finds out before the work whether a plot can be drawn, and written there: see also `check_file`.
void check_picture(const std::string& file, Session& session);

/// An `Album` as the bytes of a file.
std::string draw_picture(const Album& album, const ComponentSpec& picture, Session& session);

/// Draws an `Album` into a file ("-" is standard output), and returns its size in bytes.
std::size_t write_picture(const Album& album, const ComponentSpec& picture, const std::string& file,
                          Session& session);

}  // namespace cairn::app
