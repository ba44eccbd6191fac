// SPDX-License-Identifier: BSD-3-Clause
#include "page.hpp"

#include <stdexcept>

namespace cairn::performance {
namespace {

std::string marker(const Section& section) { return "<!-- table:" + section.name + " -->\n"; }

}  // namespace

bool has_place(const Section& section, const std::string& page) {
  return page.find(marker(section)) != std::string::npos;
}

void put(const Section& section, std::string& page) {
  const std::string begin = marker(section), end = "<!-- /table -->";
  const std::size_t at = page.find(begin);
  const std::size_t from = at + begin.size();
  const std::size_t to = at == std::string::npos ? at : page.find(end, from);
  if (to == std::string::npos)
    throw std::runtime_error("the page has no place for the table " + section.name);
  page.replace(from, to - from, section.markdown);
}

}  // namespace cairn::performance
