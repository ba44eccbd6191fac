# SPDX-License-Identifier: BSD-3-Clause
# An image of Debian 12 with the program, the Python package, and the plugins that need nothing under the GPL; those that do
# (cholmod, spqr, ceres) are one package each: see docs/install.md. The compiler stays in the first stage.
#
#     docker build -t cairn .
#     docker run --rm -v "$PWD:/data" cairn optimize my.g2o -o optimized.g2o
#     docker run --rm -v "$PWD:/data" --entrypoint python3 cairn my_script.py
FROM debian:12 AS build
COPY . /cairn
WORKDIR /cairn
RUN ./dev package

FROM debian:12-slim
COPY --from=build /cairn/build/package/packages /packages
RUN apt-get update && \
    apt-get install -y --no-install-recommends /packages/cairn_*.deb /packages/libcairn0*.deb /packages/python3-cairn_*.deb \
      python3-matplotlib /packages/cairn-plugin-exploration_*.deb /packages/cairn-plugin-lapack_*.deb && \
    rm -rf /packages /var/lib/apt/lists/*
WORKDIR /data
ENTRYPOINT ["cairn"]
