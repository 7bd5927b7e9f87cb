# Shared by every command here: the repository root, the number of cores, installing Debian packages once, building, data.
# Sourced, not run.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cores=$(nproc)

say() { printf '\n== %s\n' "$*" >&2; }

# need FILE...: installs the packages listed in the files that are not installed yet (root, or sudo). Node.js from elsewhere,
# which brings npm along and does not go with Debian's, counts as both.
need() {
  local missing=() name
  while read -r name; do
    case $name in nodejs | npm) command -v node >/dev/null && command -v npm >/dev/null && continue ;; esac
    dpkg-query -W -f='${db:Status-Status}' "$name" 2>/dev/null | grep -qx installed || missing+=("$name")
  done < <(cat "$@" | sed 's/#.*//' | tr -d ' \t' | grep -v '^$')
  [ ${#missing[@]} -eq 0 ] && return 0
  local as_root=()
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || { echo "these Debian packages are missing and neither root nor sudo is here to install them: ${missing[*]}" >&2; return 1; }
    as_root=(sudo)
  fi
  say "installing ${#missing[@]} Debian packages: ${missing[*]}"
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get update -qq
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
}

# build PRESET [TARGET...]: configures and builds all, or these; a second call does only what changed.
build() {
  local preset=$1 log; shift
  log=$(mktemp)
  (cd "$root" && cmake --preset "$preset") >"$log" 2>&1 || { cat "$log" >&2; rm -f "$log"; return 1; }
  rm -f "$log"
  (cd "$root" && cmake --build --preset "$preset" --parallel "$cores" ${1:+--target "$@"})
}

# find_data: exports CALIB_DATA, the folder of measurements, where it is not set: ../shared/data when that is there, else `none`.
find_data() {
  if [ -z "${CALIB_DATA:-}" ] && [ -d "$root/../shared/data" ]; then
    CALIB_DATA=$(realpath "$root/../shared/data")
  fi
  export CALIB_DATA=${CALIB_DATA:-none}
}
