# The demonstration in a container: docker build -t swath_sysid . && docker run --rm -v "$PWD/out:/out" swath_sysid
FROM python:3.12-slim-bookworm

ENV OMP_NUM_THREADS=1 PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
# read-only and for any user: kernels are compiled here, for any processor, and only /tmp and /out are written to
ENV NUMBA_CACHE_DIR=/var/cache NUMBA_CPU_NAME=generic MPLCONFIGDIR=/tmp/matplotlib ROS_LOG_DIR=/tmp/ros
COPY . /src
RUN pip install '/src[ros,fast]' && swath-sysid compile --quiet && rm -r /src \
  && useradd sailor && install -d -m 1777 /out
USER sailor
WORKDIR /out
VOLUME /out
ENTRYPOINT ["swath-sysid"]
CMD ["demo", "--output", "/out"]
