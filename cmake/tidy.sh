#!/usr/bin/env bash
# tidy.sh [FILE...]: clang-format (nothing is changed, differences are errors) and clang-tidy with .clang-tidy. The flags
# are given here and not taken from the build: clang understands neither GCC's precompiled headers nor all its flags.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

files=("$@")
if ((${#files[@]} == 0)); then
  mapfile -t files < <(find src apps benchmarks examples fuzz tests -name '*.h' -o -name '*.cc' | sort)
fi
((${#files[@]})) || { echo "tidy: no files"; exit 0; }

clang-format --dry-run -Werror "${files[@]}"
flags=(-std=c++20 -Isrc -I. -Itests -isystem /usr/include/eigen3 -DORIEL_SOURCE_DIR='""' -DORIEL_DATA_DIR='""'
  -DORIEL_COMMAND='""' -DORIEL_SHARED_DIR='""' -DORIEL_VERSION='""')
printf '%s\0' "${files[@]}" | grep -z '\.cc$' |
  xargs -0 -r -n 4 -P 2 sh -c 'clang-tidy --quiet --warnings-as-errors="*" "$@" -- '"$(printf '%q ' "${flags[@]}")" sh
echo "tidy: ${#files[@]} files clean"
