# Sourced by scripts/setup: builds libraries that the release has no package of (dependencies/from-source.txt) into
# build/dependencies, where CMakeLists.txt looks last. Nothing outside of the checkout changes; no root is needed.
DEPENDENCIES=$CHECKOUT/build/dependencies
FROM_SOURCE=$CHECKOUT/dependencies/from-source.txt
# Of these Debian releases the source packages are taken, the first that can be had.
SOURCE_RELEASES='bookworm trixie'

# What was built for another release of the system must not stay in the way of what this one packages.
forget_other_release() {
  [ ! -d "$DEPENDENCIES/built" ] || [ "$(cat "$DEPENDENCIES/release" 2>/dev/null)" = "$RELEASE" ] ||
    rm -rf "$DEPENDENCIES"
}

is_built() { [ -e "$DEPENDENCIES/built/$1" ]; }

can_be_built() { awk -v package="$1" '$1 == package { found = 1 } END { exit !found }' "$FROM_SOURCE"; }

# Fetches the authors' archive of a source package of Debian. apt holds it against the archive's signed index.
fetch_from_debian() {
  local source=$1 folder=$2 work=$DEPENDENCIES/apt mirror keyring release options
  mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Origin: Debian' 'Label: Debian' |
    head -n 1)
  [ -n "$mirror" ] || return 1
  keyring=/usr/share/keyrings/debian-archive-keyring.gpg
  [ -e "$keyring" ] || return 1
  for release in $SOURCE_RELEASES; do
    rm -rf "$work/download"
    mkdir -p "$work/$release/lists/partial" "$work/cache/archives/partial" "$work/download"
    echo "deb-src [signed-by=$keyring] $mirror $release main" >"$work/$release/sources.list"
    options=(-o "Dir::Etc::SourceList=$work/$release/sources.list" -o Dir::Etc::SourceParts=/dev/null
      -o "Dir::State::Lists=$work/$release/lists" -o "Dir::Cache=$work/cache" -o APT::Sandbox::User=root)
    if [ ! -e "$work/$release/updated" ]; then
      apt-get "${options[@]}" -o APT::Update::Error-Mode=any update || continue
      touch "$work/$release/updated"
    fi
    if (cd "$work/download" && apt-get "${options[@]}" source --tar-only "$source"); then
      mkdir -p "$folder.part"
      tar -C "$folder.part" -xf "$work/download"/*.orig.tar.* && mv "$folder.part" "$folder" && return
    fi
  done
  return 1
}

fetch_from_authors() {
  command -v vcs >/dev/null || return 1
  vcs import --skip-existing "$DEPENDENCIES/source" <"$CHECKOUT/dependencies/noetic.repos"
}

# build_from_source PACKAGE...
build_from_source() {
  local package source arguments folder list log=$BUILD/from_source.log n=0 generator=()
  command -v cmake >/dev/null || fail "no cmake; install your release's packages cmake and g++ first"
  ! command -v ninja >/dev/null || generator=(-G Ninja)
  mkdir -p "$DEPENDENCIES/source" "$DEPENDENCIES/built"
  need_space "$DEPENDENCIES" 300 "building from source"
  echo "$RELEASE" >"$DEPENDENCIES/release"
  : >"$log"
  for package; do
    n=$((n + 1))
    read -r source arguments < <(awk -v package="$package" '$1 == package { $1 = ""; print }' "$FROM_SOURCE")
    folder=$DEPENDENCIES/source/$source
    echo "setup: building $source from source ($n of $#), for want of a package $package"
    if [ ! -d "$folder" ]; then
      fetch_from_debian "$source" "$folder" >>"$log" 2>&1 || fetch_from_authors >>"$log" 2>&1 || true
    fi
    # An archive may hold its files in a folder of its own.
    list=$({ find "$folder" -maxdepth 2 -name CMakeLists.txt -printf '%d %p\n' 2>/dev/null || true; } | sort -n |
      head -n 1)
    if [ -z "$list" ]; then
      reason=$(explain "$log")
      fail "no source of $source: ${reason:-install vcs (Debian: vcstool), which fetches it; the output is in $log}"
    fi
    list=${list#* }
    # Static and position-independent: our libraries keep what they use of them, and need no path to this folder.
    # shellcheck disable=SC2086
    if ! { cmake "${generator[@]}" -S "${list%/*}" -B "$folder.build" $arguments -DCMAKE_BUILD_TYPE=Release \
      -DBUILD_TESTING=OFF -DBUILD_SHARED_LIBS=OFF -DCMAKE_POSITION_INDEPENDENT_CODE=ON \
      "-DCMAKE_INSTALL_PREFIX=$DEPENDENCIES" -DCMAKE_INSTALL_LIBDIR=lib &&
      cmake --build "$folder.build" -- "-j$(nproc)" && cmake --install "$folder.build"; } >>"$log" 2>&1; then
      reason=$(explain "$log")
      fail "$source could not be built: ${reason:-the whole output is in $log}"
    fi
    touch "$DEPENDENCIES/built/$package"
    rm -rf "$folder.build"
  done
  rm -rf "$DEPENDENCIES/apt"
  [ "$(id -u)" != 0 ] || chown -R --reference="$CHECKOUT" "$DEPENDENCIES" "$log"
}
