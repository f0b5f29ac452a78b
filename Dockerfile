# Poise with its simulator, and everything compiled: after `.ci/build`
#   docker build -t poise .
#   docker run --rm -v "$PWD/runs:/poise/runs" poise run squat
FROM python:3.13-slim

# MuJoCo draws the video without a screen.
# hadolint ignore=DL3008
RUN apt-get update \
  && apt-get install -y --no-install-recommends libegl1 \
  && rm -rf /var/lib/apt/lists/*

ENV MUJOCO_GL=egl NUMBA_CACHE_DIR=/opt/poise/compiled OMP_NUM_THREADS=1
COPY requirements.lock dist/*.whl /opt/poise/
RUN pip install --no-cache-dir -c /opt/poise/requirements.lock --find-links /opt/poise "poise[sim]" \
  && poise warmup

WORKDIR /poise
ENTRYPOINT ["poise"]
CMD ["run"]
