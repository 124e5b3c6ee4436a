# The monitor and its tools on ROS Noetic (Ubuntu 20.04). Nobody has built this image yet.
#   docker build -f docker/noetic.Dockerfile -t deformable_ccd:noetic .
#   docker run --rm --net=host deformable_ccd:noetic roslaunch deformable_ccd monitor.launch mesh:=/tracker/cloth rows:=20 cols:=30
FROM ros:noetic
ENV DEBIAN_FRONTEND=noninteractive
WORKDIR /source
COPY . .
# What dependencies/keys.csv names for this system, and what scripts/setup --from-source takes to fetch and build the rest.
RUN apt-get update && apt-get install -y --no-install-recommends ninja-build pkg-config python3-vcstool libjs-three \
      $(tail -n +2 dependencies/keys.csv | cut -d, -f4) && rm -rf /var/lib/apt/lists/*
RUN . /opt/ros/noetic/setup.sh && scripts/setup --from-source && scripts/build
# ros:noetic's own entry point knows nothing of this workspace.
ENTRYPOINT ["/bin/bash", "-c", ". /source/build/devel/setup.bash && exec \"$@\"", "bash"]
CMD ["roslaunch", "deformable_ccd", "monitor.launch"]
