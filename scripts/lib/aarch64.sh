# Sourced by scripts/test --aarch64: cross-compiles the core and its unit tests for 64-bit ARM and runs them under qemu-user.
# The ARM packages are unpacked under build/, not installed: the system stays as it is.
AARCH64_PACKAGES=(libhwy-dev libhwy1 libgmp-dev libgmp10 libtbb-dev libtbb12 libtbbmalloc2 libgtest-dev zlib1g-dev zlib1g
  librapidcheck-dev)
# Headers without a processor, from the system itself.
AARCH64_SHARED=(include/eigen3 include/nlohmann include/CLI share/eigen3 share/cmake lib/cmake)

aarch64_fetch() {
  local root=$1 package
  [ ! -e "$root/complete" ] || return 0
  rm -rf "$root"
  mkdir -p "$root"/apt/lists/partial "$root"/apt/cache/archives/partial "$root"/usr/{include,share,lib}
  touch "$root/apt/status"
  local options=(-o APT::Architecture=arm64 -o APT::Architectures=arm64 -o "Dir::State::Lists=$root/apt/lists"
    -o "Dir::Cache=$root/apt/cache" -o "Dir::State::status=$root/apt/status" -o APT::Sandbox::User=)
  apt-get "${options[@]}" update || return 1
  (cd "$root/apt" && apt-get "${options[@]}" download "${AARCH64_PACKAGES[@]}") || return 1
  for package in "$root"/apt/*.deb; do dpkg -x "$package" "$root" || return 1; done
  for package in "${AARCH64_SHARED[@]}"; do
    if [ -e "/usr/$package" ] && [ ! -e "$root/usr/$package" ]; then ln -s "/usr/$package" "$root/usr/$package"; fi
  done
  touch "$root/complete"
}

# aarch64_test TREE RUNNER_ARGUMENT...: builds in TREE; replaces the shell by the runner.
aarch64_test() {
  local tree=$1 root=$1/root tool
  shift
  for tool in aarch64-linux-gnu-g++ qemu-aarch64-static; do
    if ! command -v "$tool" >/dev/null; then
      echo "test: skipped: no $tool; apt-get install g++-aarch64-linux-gnu qemu-user-static"
      echo "0 passed, 0 failed, 1 skipped"
      exit 0
    fi
  done
  mkdir -p "$tree"
  aarch64_fetch "$root" >"$tree/build.log" 2>&1 || { tail -n 20 "$tree/build.log"; not_run "no ARM packages"; }
  cmake -G Ninja -S "$CHECKOUT" -B "$tree" -DDEFORMABLE_CCD_CORE_ONLY=ON -DCMAKE_BUILD_TYPE=Release "-DAARCH64_ROOT=$root" \
    "-DCMAKE_TOOLCHAIN_FILE=$CHECKOUT/cmake/aarch64.cmake" >>"$tree/build.log" 2>&1 &&
    cmake --build "$tree" --target unit_tests >>"$tree/build.log" 2>&1 ||
    { tail -n 40 "$tree/build.log"; not_run "the build for aarch64 failed"; }
  # The kernels and the core above them on the SIMD targets of ARM. What is slow or statistical says the same everywhere.
  exec "$PYTHON" "$CHECKOUT/scripts/lib/run_tests.py" --build "$tree" --only unit_tests \
    --emulator "qemu-aarch64-static -L /usr/aarch64-linux-gnu -E LD_LIBRARY_PATH=$tree:$root/usr/lib/aarch64-linux-gnu" "$@"
}
