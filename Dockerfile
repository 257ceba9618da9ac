# Builds stratad and strata and ships them in a small image: non-root, data in /data, read-only root possible.
#   docker build -t strata .
#   docker run -p 50051:50051 -v strata-data:/data strata
FROM debian:bookworm-slim AS build
WORKDIR /src
COPY deploy/install-deps.sh deploy/
RUN bash deploy/install-deps.sh && rm -rf /var/lib/apt/lists/*
COPY . .
RUN cmake --preset release -DSTRATA_TESTS=OFF && \
    cmake --build build/release --target stratad strata && \
    strip build/release/bin/strata && strip --strip-debug build/release/bin/stratad

FROM debian:bookworm-slim
COPY deploy/install-deps.sh /tmp/
RUN bash /tmp/install-deps.sh --runtime && \
    rm -rf /var/lib/apt/lists/* /var/cache/apt /var/log/apt /var/log/dpkg.log /tmp/install-deps.sh && \
    groupadd --gid 10001 strata && \
    useradd --uid 10001 --gid 10001 --no-create-home --home-dir /data --shell /usr/sbin/nologin strata && \
    install -d -o strata -g strata -m 0750 /data
COPY --from=build /src/build/release/bin/stratad /src/build/release/bin/strata /usr/local/bin/
USER 10001:10001
VOLUME /data
EXPOSE 50051
HEALTHCHECK --interval=10s --timeout=5s --start-period=10s --retries=3 \
  CMD ["strata", "server", "health", "--server", "127.0.0.1:50051"]
STOPSIGNAL SIGTERM
ENTRYPOINT ["stratad"]
CMD ["--listen", "0.0.0.0:50051", "--data-dir", "/data", "--insecure"]
