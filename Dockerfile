# facetd in a container: `docker build -t facetd .`, or `make container` without a Docker engine.
FROM debian:bookworm-slim AS build
WORKDIR /src
COPY packages.txt ./
RUN apt-get update \
 && apt-get install -y --no-install-recommends \
      $(awk -F'[ |]+' '!/^#/ && $2 == "build" {print $1}' packages.txt) \
 && rm -rf /var/lib/apt/lists/*
COPY . .
# The demo asks every endpoint within this very image. Stripped, for debug information is nine tenths.
RUN make -j"$(nproc)" && tests/demo.sh build/release/facetd && strip build/release/facetd

FROM debian:bookworm-slim
COPY packages.txt /tmp/
RUN apt-get update \
 && apt-get install -y --no-install-recommends \
      $(awk -F'[ |]+' '!/^#/ && $2 == "run" {print $1}' /tmp/packages.txt) \
 && rm -rf /var/lib/apt/lists/* /tmp/packages.txt
COPY --from=build /src/build/release/facetd /usr/local/bin/facetd
# A number, so that an orchestrator can see that it is not root.
USER 10001:10001
ENV FACETD_BIND=0.0.0.0
EXPOSE 8080
# The binary asks itself: the image needs no curl for anything else.
HEALTHCHECK --interval=30s --timeout=5s --start-period=2s CMD ["/usr/local/bin/facetd", "--healthcheck"]
ENTRYPOINT ["/usr/local/bin/facetd"]
