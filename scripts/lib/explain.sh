# Sourced by scripts/setup (and scripts/build): turns what a failed command left in its log into one line for a person.

# explain LOG: the reason for the failure, if it is one of those that every machine knows; else nothing.
explain() {
  local log=$1 line unreachable
  unreachable='(Temporary failure resolving|Could not resolve( host)?|Could not connect to|Unable to connect to)'
  if line=$(grep -m 1 -oE "enough free space in [^ ]+" "$log"); then
    echo "the disk is full: not ${line%.}; make room and run it again"
  elif grep -qE "No space left on device|Disk quota exceeded" "$log"; then
    echo "the disk is full (MB free in /usr: $(free_mb /usr), here: $(free_mb "$CHECKOUT")); make room and run it again"
  elif line=$(grep -m 1 -oE "$unreachable:? '?[^ ']+'?" "$log"); then
    echo "no network, or none to the package server ($line); run it again when there is"
  elif line=$(grep -m 1 -oE 'Failed to fetch [^ ]+( .*)?' "$log"); then
    echo "the package server does not deliver ($line); try again later, or another server in /etc/apt/sources.list"
  elif grep -qE 'Could not get lock|is another process using it' "$log"; then
    echo "another program is installing packages; run it again when that is done"
  elif grep -q 'Read-only file system' "$log"; then
    echo "the file system is mounted read-only"
  elif line=$(grep -m 1 -oE '[^ ]+ : (Depends|Conflicts|Breaks): .*' "$log"); then
    echo "packages that are installed here stand against it ($line); see 'apt-get check' and 'apt-mark showhold'"
  elif grep -qE 'Killed signal terminated program|virtual memory exhausted|cannot allocate memory' "$log"; then
    echo "the compiler ran out of memory; fewer at a time need less"
  fi
}

# free_mb PATH: what is free on the file system of PATH, or of the nearest folder above it that exists.
free_mb() {
  local path=$1
  while [ ! -e "$path" ]; do path=$(dirname "$path"); done
  echo "$(($(df -B1 --output=avail "$path" | tail -n 1) / 1000000))"
}

# need_space PATH MB WHAT: ends the program with one line where there is less.
need_space() {
  local free
  free=$(free_mb "$1")
  [ "$free" -ge "$2" ] ||
    fail "the disk is full: $3 needs $2 MB in $1, and $free MB are free; make room and run it again"
}
