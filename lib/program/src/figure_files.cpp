// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/figure_files.hpp"

#include "cairn/io/format.hpp"
#include "cairn/program/graph_files.hpp"

namespace cairn::app {

OptionFields<FigureFiles> FigureFiles::fields() {
  return OptionFields<FigureFiles>()
      .text("csv", &FigureFiles::csv, "the figures as CSV, a line of titles and one of values")
      .placeholder("FILE")
      .text("latex", &FigureFiles::latex, "the figures as a tabular of LaTeX")
      .placeholder("FILE");
}

void FigureFiles::check(Session& session) const {
  check_file(csv, session);
  check_file(latex, session);
}

void FigureFiles::write(const Figures& figures, Results& results) const {
  results.write(csv, [&] { write_file(csv, figures.csv()); });
  results.write(latex, [&] { write_file(latex, figures.table().latex()); });
}

}  // namespace cairn::app
