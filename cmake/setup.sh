# Sourced by ./run and ./test: the Debian 12 packages by name, in this one place, and what both scripts do.
# shellcheck shell=bash

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

packages_build=(
  g++              # C++20
  cmake            # 3.25
  ninja-build      # the generator of all presets
  ccache           # a second build of the same sources costs seconds
)
packages_run=(
  libeigen3-dev       # dense kernels inside the core; the only dependency of its objects besides METIS
  libmetis-dev        # nested dissection for large pose graphs
  libcli11-dev        # the command's options
  libfmt-dev          # the command's tables
  libyaml-cpp-dev     # sensor calibrations, configuration
  nlohmann-json3-dev  # --json
  zlib1g-dev          # problem files that are gzip
  libbz2-dev          # problem files that are bzip2, as BAL's are published
)
packages_test=(
  libgtest-dev         # tests
  libceres-dev         # the oracle and rival: engines/ceres, benchmarks
  libopenblas-dev      # so that Ceres is measured with the fast BLAS
  libgoogle-glog-dev   # Ceres wants it
)
packages_fuzz=(
  clang            # libFuzzer
  libclang-rt-dev  # and its runtime
  bzip2            # for the seeds
)
packages_tidy=(
  clang-format
  clang-tidy
)

fail() {
  printf '%s: %s\n' "$(basename "$0")" "$*" >&2
  exit 2
}

# Installs what is missing of the packages named. Sets installed_now=1 where it did.
installed_now=0
need_packages() {
  local missing=() package
  command -v dpkg-query >/dev/null || fail "expected Debian 12 (dpkg): install by hand what stands for: $*"
  for package in "$@"; do
    [[ $(dpkg-query -W -f '${Status}' "$package" 2>/dev/null) == 'install ok installed' ]] || missing+=("$package")
  done
  ((${#missing[@]})) || return 0
  local sudo=()
  if ((EUID != 0)); then
    command -v sudo >/dev/null && sudo=(sudo)
    if ((${#sudo[@]} == 0)) || ! { sudo -n true 2>/dev/null || [[ -t 0 ]]; }; then
      fail "missing packages, and neither root nor sudo to install them: apt-get install -y ${missing[*]}"
    fi
  fi
  echo "installing: ${missing[*]}"
  local install=("${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends)
  local log
  log=$(mktemp)
  # The lists of a fresh machine are empty or old: they are fetched only when installing without it fails.
  if ! "${install[@]}" "${missing[@]}" >"$log" 2>&1; then
    "${sudo[@]}" apt-get update -qq >"$log" 2>&1 && "${install[@]}" "${missing[@]}" >"$log" 2>&1 || {
      tail -n 20 "$log" >&2
      rm -f "$log"
      fail "could not install: apt-get install -y ${missing[*]}"
    }
  fi
  rm -f "$log"
  installed_now=1
}

# configure PRESET [-DNAME=VALUE...]: only where it is needed; ninja itself runs CMake anew when its files change.
configure() {
  local preset=$1
  shift
  if ((installed_now)) || (($#)) || [[ ! -f $root/build/$preset/build.ninja ]]; then
    (cd "$root" && cmake --preset "$preset" "$@") >"$root/build-$preset.log" 2>&1 || {
      cat "$root/build-$preset.log" >&2
      rm -f "$root/build-$preset.log"
      fail "could not configure the preset '$preset'"
    }
    grep -E '^-- oriel:|CMake (Deprecation )?Warning' "$root/build-$preset.log" || true
    rm -f "$root/build-$preset.log"
  fi
}

# build PRESET [TARGET...]
build() {
  local preset=$1
  shift
  local targets=()
  (($#)) && targets=(--target "$@")
  cmake --build "$root/build/$preset" "${targets[@]}" || fail "the build of '$preset' failed, see above"
}
