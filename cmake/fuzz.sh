#!/usr/bin/env bash
# fuzz.sh [SECONDS]: the libFuzzer programs of the readers, SECONDS each (60), from the heads of the project's own files on.
# What they find, and what they learn, stays in build/fuzz/<name>/; a crash ends the run with its input's name.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

seconds=${1:-60}
[[ $seconds =~ ^[1-9][0-9]*$ ]] || fail "--fuzz: expected seconds, got '$seconds'"
need_packages "${packages_build[@]}" "${packages_run[@]}" "${packages_fuzz[@]}"
configure fuzz
build fuzz oriel_fuzzers

# Large seeds make slow runs.
seeds() {
  local folder=$1 file
  case $(basename "$folder") in
    pose_graph) for file in "$root"/data/*.g2o; do
                  { grep -m 4 VERTEX "$file"; grep -m 4 EDGE "$file"; } >"$folder/seed_$(basename "$file")" || true
                done
                cp "$root"/fuzz/seeds/*.g2o "$folder/" ;;
    bal) cp "$root/fuzz/seeds/small.bal" "$folder/" ;;
    visual_map) cp "$root/fuzz/seeds/small.map" "$folder/" ;;
    packed) gzip -c "$root/fuzz/seeds/small.bal" >"$folder/small.gz"
            bzip2 -c "$root/fuzz/seeds/small.bal" >"$folder/small.bz2" ;;
    tables) for file in imu.csv tracks.csv groundtruth.tum; do
              [[ ! -f $root/data/euroc_v101/$file ]] || head -n 5 "$root/data/euroc_v101/$file" >"$folder/$file"
            done ;;
  esac
}

for program in "$root"/build/fuzz/fuzzers/*_fuzzer; do
  folder=$root/build/fuzz/$(basename "$program" _fuzzer)
  mkdir -p "$folder"
  seeds "$folder"
  echo "fuzzing: $(basename "$program"), $seconds s"
  (cd "$folder" && "$program" -max_total_time="$seconds" -dict="$root/fuzz/problem.dict" -max_len=4096 -verbosity=0 \
    -print_final_stats=1 . 2>&1) || fail "$(basename "$program") found an input, see above and $folder"
done
