# The demo in RViz, which draws on the X server of the machine that runs it.
#   docker build -f docker/Dockerfile -t deformable_ccd:local . && docker build -f docker/demo.Dockerfile -t deformable_ccd_demo:local docker
#   docker run --rm -e DISPLAY -v /tmp/.X11-unix:/tmp/.X11-unix --user "$(id -u)" -e HOME=/tmp deformable_ccd_demo:local
FROM deformable_ccd:local
ENV DEBIAN_FRONTEND=noninteractive
RUN apt-get update && apt-get install -y --no-install-recommends rviz && rm -rf /var/lib/apt/lists/*
CMD ["roslaunch", "deformable_ccd", "demo.launch", "rviz:=true"]
