# The program smaclite-pool and its Python package:
#     docker build --tag smaclite-pool .
#     docker run --rm --shm-size=1g smaclite-pool smaclite-pool doctor
# A pool keeps its batches in /dev/shm, of which Docker gives a container 64 MB: set --shm-size. Pool and learner in two
# containers: compose.yaml, docs/how-to/operating.md.

FROM rust:1-slim-trixie AS build
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends python3-venv \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /src
COPY . .
# The caches are kept between builds on one machine; the wheel leaves them.
RUN --mount=type=cache,target=/usr/local/cargo/registry --mount=type=cache,target=/src/target \
    python3 -m venv /venv \
    && /venv/bin/pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.13-slim-trixie
LABEL org.opencontainers.image.title="smaclite-pool" \
      org.opencontainers.image.description="Environment pool for multi-agent reinforcement learning" \
      org.opencontainers.image.source="https://github.com/smaclite-pool/smaclite-pool" \
      org.opencontainers.image.licenses="MIT OR Apache-2.0"
RUN --mount=type=bind,from=build,source=/wheels,target=/wheels \
    pip install --no-cache-dir /wheels/*.whl
COPY LICENSE-MIT LICENSE-APACHE /usr/share/doc/smaclite-pool/
# Pools accept only processes of their own user, and only a folder that is private to that user. A volume that is new
# takes over owner and mode of the folder that it is mounted at.
RUN useradd --uid 1000 --create-home pool \
    && install --directory --owner=pool --group=pool --mode=700 /pools /runs
ENV SMACLITE_POOL_ROOT=/pools
USER 1000:1000
WORKDIR /home/pool
CMD ["smaclite-pool", "doctor"]
