# The service with the shipped models on a CPU: no torch, no compiler, not root.
#   docker build --tag wayfarer .
#   docker run --rm -p 127.0.0.1:8080:8080 -p 127.0.0.1:50051:50051 wayfarer serve --insecure-no-auth
# The flag is needed since the container listens on all its interfaces and nothing says who may
# call: harmless with ports of this machine only. Keys, tokens, TLS: docs/operations.md.
# `make image-check` builds it, runs it and lets an agent walk in it.

FROM debian:trixie-slim AS python
ARG DEBIAN_FRONTEND=noninteractive
RUN apt-get update && apt-get install --yes --no-install-recommends python3 \
  && rm -rf /var/lib/apt/lists/*

FROM python AS build
ARG DEBIAN_FRONTEND=noninteractive
RUN apt-get update && apt-get install --yes --no-install-recommends python3-venv
WORKDIR /src
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_ROOT_USER_ACTION=ignore
# what serves has no pip; that of the other environment installs into it
RUN python3 -m venv /opt/build && python3 -m venv --without-pip /opt/wayfarer
COPY requirements requirements
RUN /opt/build/bin/pip install --no-deps --require-hashes --requirement requirements/build.txt \
  && /opt/build/bin/pip --python /opt/wayfarer install --no-deps --require-hashes \
  --requirement requirements/serve.txt
COPY pyproject.toml README.md LICENSE NOTICE ./
COPY proto proto
COPY service service
# the service has links to these
COPY viewer viewer
COPY clients/web/src clients/web/src
COPY clients/python/wayfarer_client clients/python/wayfarer_client
RUN /opt/build/bin/pip wheel --no-deps --no-build-isolation --wheel-dir /wheels . \
  && /opt/build/bin/pip --python /opt/wayfarer install --no-deps --no-index /wheels/*.whl

FROM python
RUN useradd --uid 10001 --no-create-home --shell /usr/sbin/nologin wayfarer
COPY --from=build /opt/wayfarer /opt/wayfarer
COPY LICENSE NOTICE /usr/share/doc/wayfarer/
ENV PATH=/opt/wayfarer/bin:$PATH PYTHONUNBUFFERED=1 PYTHONDONTWRITEBYTECODE=1
# inside the container every interface is meant; what is published is chosen by `docker run -p`
ENV WAYFARER_HOST=0.0.0.0
# a volume mounted here belongs to the service; it is used when WAYFARER_STATE_DIR names it
RUN install --directory --owner wayfarer --mode 700 /var/lib/wayfarer
# what numba compiles is kept here; the image brings it, for processors like the builder's
ENV NUMBA_CACHE_DIR=/var/cache/wayfarer
RUN install --directory --owner wayfarer --mode 700 /var/cache/wayfarer
USER wayfarer
RUN /opt/wayfarer/bin/python3 -m wayfarer.transport.prepare
EXPOSE 8080 50051
HEALTHCHECK --interval=10s --timeout=3s --start-period=20s --retries=3 \
  CMD ["wayfarer", "probe"]
STOPSIGNAL SIGTERM
ENTRYPOINT ["wayfarer"]
CMD ["serve"]
