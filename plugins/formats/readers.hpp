// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "cairn/io/format.hpp"
#include "cairn/io/stream_format.hpp"

namespace cairn::formats {

// Each reads a whole text as `Format::read` does.

Graph read_g2o(std::string_view text, const std::string& name, Registry& types,
               const ReadOptions& options, ReadReport& report);
Graph read_toro(std::string_view text, const std::string& name, Registry& types,
                const ReadOptions& options, ReadReport& report);
Graph read_isam(std::string_view text, const std::string& name, Registry& types,
                const ReadOptions& options, ReadReport& report);
Graph read_bal(std::string_view text, const std::string& name, Registry& types,
               const ReadOptions& options, ReadReport& report);
Graph read_pyfg(std::string_view text, const std::string& name, Registry& types,
                const ReadOptions& options, ReadReport& report);
Graph read_tum(std::string_view text, const std::string& name, Registry& types,
               const ReadOptions& options, ReadReport& report);
Graph read_euroc(std::string_view text, const std::string& name, Registry& types,
                 const ReadOptions& options, ReadReport& report);
Graph read_kitti(std::string_view text, const std::string& name, Registry& types,
                 const ReadOptions& options, ReadReport& report);
Graph read_table(std::string_view text, const std::string& name, Registry& types,
                 const ReadOptions& options, ReadReport& report);

/// Reads g2o line by line.
std::unique_ptr<StreamFormat> make_g2o_stream();

}  // namespace cairn::formats
