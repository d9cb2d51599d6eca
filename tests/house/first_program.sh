#!/usr/bin/env bash
# first_program.sh COMPILER SOURCE INCLUDE_DIR LIBRARY OUTPUT [LINK_FLAG...]
# CPU time (user + system) that compiling and linking the first program takes: the best of three, since what else the
# machine does can only add to it. Fails above the budget.
set -euo pipefail
compiler=$1 source=$2 include=$3 library=$4 output=$5
shift 5
budget_ms=3000
best_ms=1000000
TIMEFORMAT='%U %S'
for _ in 1 2 3; do
  cpu=$({ time "$compiler" -std=c++20 -O2 -I"$include" "$source" "$library" "$@" -lpthread -o "$output"; } 2>&1) ||
    { printf '%s\n' "$cpu" >&2; exit 1; }
  # Warnings may stand before it: the times are the last line.
  ms=$(printf '%s\n' "$cpu" | tail -n 1 | awk '{ printf "%d", ($1 + $2) * 1000 }')
  if ((ms < best_ms)); then best_ms=$ms; fi
done
echo "first program: $best_ms ms of CPU time to compile and link (budget $budget_ms ms)"
((best_ms <= budget_ms))
