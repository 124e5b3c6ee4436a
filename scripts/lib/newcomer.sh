#!/usr/bin/env bash
# What a newcomer types, before the tests' packages could hide that something is missing: the README's first command, the next
# one that this names, then every command of the pages. Ends where one of the first two fails. What the pages' tests print, their
# verdict too, goes to pages.log in the build folder, which PagesRunner (scripts/lib/runners.py) counts.
set -euo pipefail
. "$(dirname "$0")/common.sh"

"$CHECKOUT/scripts/demo"
echo "scripts/demo took $SECONDS s, downloads included"
"$CHECKOUT/scripts/build"
use_ros_python
cd "$CHECKOUT/test/package"
"$PYTHON" -m unittest -v commands_test.py >"$BUILD/pages.log" 2>&1 || true
