// SPDX-License-Identifier: BSD-3-Clause
#include "page.hpp"

#include <stdexcept>

namespace cairn::performance {

void put(const Section& section, std::string& page) {
  const std::string begin = "<!-- table:" + section.name + " -->\n", end = "<!-- /table -->";
  const std::size_t at = page.find(begin);
  const std::size_t from = at + begin.size();
  const std::size_t to = at == std::string::npos ? at : page.find(end, from);
  if (to == std::string::npos)
    throw std::runtime_error("the page has no place for the table " + section.name);
  page.replace(from, to - from, section.markdown);
}

}  // namespace cairn::performance
