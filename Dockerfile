# The demonstration in a container: docker build -t swath_sysid . && docker run --rm -v "$PWD/out:/out" swath_sysid
FROM python:3.12-slim-bookworm

ENV OMP_NUM_THREADS=1 PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
COPY . /src
RUN pip install '/src[ros,fast]' && rm -r /src && useradd --create-home sailor && install -d -o sailor /out
USER sailor
WORKDIR /out
VOLUME /out
ENTRYPOINT ["swath-sysid"]
CMD ["demo", "--output", "/out"]
