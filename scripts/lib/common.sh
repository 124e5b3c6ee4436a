# Sourced by the scripts beside this folder: where the checkout is, and which Python belongs to ROS.
CHECKOUT=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd -P)
# The workspace; scripts/test builds others below build/ with other flags.
BUILD=${DEFORMABLE_CCD_WORKSPACE:-$CHECKOUT/build}
TOOLS=$BUILD/devel/lib/deformable_ccd

fail() {
  printf '%s: %s\n' "$(basename "$0")" "$*" >&2
  exit 1
}

# Puts the Python that has the ROS modules first in PATH: a pyenv or conda one may stand before it, and CMake's searches
# and the `env python3` lines of ROS tools would find that.
use_ros_python() {
  local candidate
  for candidate in $(type -ap python3) /usr/bin/python3; do
    if "$candidate" -c 'import catkin_pkg, genmsg, rospkg' 2>/dev/null; then
      PYTHON=$candidate
      PATH=$(dirname "$candidate"):$PATH
      export PATH
      return
    fi
  done
  fail "no python3 with the ROS modules catkin_pkg, genmsg and rospkg; run scripts/setup, or source your ROS setup file"
}

# The environment of the built workspace. ROS's setup files read variables that may be unset.
use_workspace() {
  set +u
  # shellcheck disable=SC1091
  . "$BUILD/devel/setup.bash"
  set -u
}
