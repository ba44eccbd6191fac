# SPDX-License-Identifier: BSD-3-Clause
# Builds the page in a copy of its sources, so that nothing is written into the source tree.
file(COPY ${SOURCE}/ DESTINATION ${BUILD} PATTERN node_modules EXCLUDE PATTERN dist EXCLUDE)
foreach(step IN ITEMS "ci;--no-audit;--no-fund" "run;build")
  execute_process(COMMAND ${NPM} ${step} WORKING_DIRECTORY ${BUILD} COMMAND_ERROR_IS_FATAL ANY)
endforeach()
get_filename_component(folder ${PAGE} DIRECTORY)
file(COPY ${BUILD}/dist/report.html DESTINATION ${folder})
file(TOUCH ${PAGE})
