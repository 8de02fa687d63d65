# The service with the shipped models on a CPU: no torch, no compiler, not root.
#   docker build --tag wayfarer .
#   docker run --rm -p 127.0.0.1:8080:8080 -p 127.0.0.1:50051:50051 wayfarer serve --insecure-no-auth
# The flag is needed since the container listens on all its interfaces and nothing says who may
# call: harmless with ports of this machine only. Keys, tokens, TLS: docs/operations.md.

FROM python:3.12-slim-bookworm AS build
WORKDIR /src
RUN python -m venv /opt/wayfarer
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
COPY pyproject.toml README.md LICENSE NOTICE ./
COPY proto proto
COPY service service
RUN /opt/wayfarer/bin/pip install .

FROM python:3.12-slim-bookworm
RUN useradd --system --uid 10001 --no-create-home --shell /usr/sbin/nologin wayfarer
COPY --from=build /opt/wayfarer /opt/wayfarer
COPY LICENSE NOTICE /usr/share/doc/wayfarer/
ENV PATH=/opt/wayfarer/bin:$PATH PYTHONUNBUFFERED=1 PYTHONDONTWRITEBYTECODE=1
# inside the container every interface is meant; what is published is chosen by `docker run -p`
ENV WAYFARER_HOST=0.0.0.0
# a volume mounted here belongs to the service; it is used when WAYFARER_STATE_DIR names it
RUN install --directory --owner wayfarer --mode 700 /var/lib/wayfarer
USER wayfarer
EXPOSE 8080 50051
HEALTHCHECK --interval=10s --timeout=3s --start-period=20s --retries=3 \
  CMD ["wayfarer", "probe"]
STOPSIGNAL SIGTERM
ENTRYPOINT ["wayfarer"]
CMD ["serve"]
