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

# Runs a command that takes minutes and writes to the file LOG, and says how far it is: `COUNT_FUNCTION LOG` prints "N of M".
# On a terminal one line changes in place, elsewhere there is a line every 20 s.
# usage: with_progress WHAT LOG COUNT_FUNCTION COMMAND...
with_progress() {
  local what=$1 log=$2 count=$3 started=$SECONDS shown=$SECONDS far pid status=0
  shift 3
  # A process group of its own, so that Ctrl-C ends all of it: a shell's background jobs ignore that signal.
  set -m
  "$@" </dev/null &
  pid=$!
  set +m
  trap 'kill -TERM -- "-$pid" 2>/dev/null; echo; fail "stopped; run it again, it goes on where it was"' INT TERM
  while kill -0 "$pid" 2>/dev/null; do
    sleep 0.5
    if [ -t 1 ]; then
      far=$("$count" "$log")
      printf '\r\033[K%s: %s%s s' "$what" "${far:+$far, }" "$((SECONDS - started))"
    elif [ $((SECONDS - shown)) -ge 20 ]; then
      shown=$SECONDS
      far=$("$count" "$log")
      echo "$what: ${far:+$far, }$((SECONDS - started)) s"
    fi
  done
  wait "$pid" || status=$?
  trap - INT TERM
  [ ! -t 1 ] || printf '\r\033[K'
  return "$status"
}

# How far a ninja build is, from its log.
ninja_steps() { sed -n 's/^\[\([0-9]*\)\/\([0-9]*\)\].*/\1 of \2 steps/p' "$1" | tail -n 1; }

# How far the last installation in apt's log is.
apt_steps() {
  awk '/ newly installed, / { for (i = 2; i <= NF; ++i) if ($i == "newly") all = $(i - 1); got = unpacked = ready = 0 }
    /^Get:/ { ++got } /^Unpacking / { ++unpacked } /^Setting up / { ++ready }
    END {
      if (all && unpacked >= all) print ready + 0 " of " all " packages set up"
      else if (all && unpacked) print unpacked " of " all " packages unpacked"
      else if (all && got) print got " of " all " packages downloaded"
    }' "$1"
}
