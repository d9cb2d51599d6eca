#!/usr/bin/env bash
# A wrong arity, type or noise is a compile error that says so in one line (behaviour V9).
# Usage: compile_fail.sh COMPILER SOURCE_ROOT SCRATCH_DIRECTORY
set -u
compiler=$1 root=$2 scratch=$3
mkdir -p "$scratch"
failures=0

# expect NAME MESSAGE 'statement in main': the message comes exactly once, as an error; an empty one: it compiles.
expect() {
  local file="$scratch/$1.cc" log="$scratch/$1.log"
  cat > "$file" <<EOF
#include "oriel/graph/graph.h"
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
using namespace oriel;
struct NoName { static constexpr int kDim = 1; double x; NoName plus(const Vec1d&) const; Vec1d minus(const NoName&) const; };
struct NotAResidual { double measured; };
int main() {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto pose = edit.add(Pose3d{});
  const auto point = edit.add(Point3d{});
  (void)pose, (void)point;
  $3;
}
EOF
  "$compiler" -std=c++20 -fsyntax-only -I"$root" "$file" > "$log" 2>&1
  local code=$?
  if [ -z "$2" ]; then
    [ $code -eq 0 ] && return
    echo "$1: should compile, but:" && head -5 "$log"
  else
    local said
    said=$(grep -c "error:.*$2" "$log")
    [ $code -ne 0 ] && [ "$said" -eq 1 ] && return
    echo "$1: expected one error about '$2', found $said; the first lines:" && grep "error" "$log" | head -5
  fi
  failures=$((failures + 1))
}

expect good "" 'edit.add(Between{Pose3d{}}, Sigma(1.0), pose, pose)'
expect wrong_arity "as many ids as the residual's Variables" 'edit.add(Between{Pose3d{}}, Sigma(1.0), pose)'
expect wrong_type "the ids must be those of the residual's Variables" 'edit.add(Prior{Pose3d{}}, Sigma(1.0), point)'
expect wrong_noise "the noise has another dimension than the residual" \
  'edit.add(Prior{Pose3d{}}, Sigmas(Vec3d::constant(1.0)), pose)'
expect wrong_information "the noise has another dimension than the residual" \
  'edit.add(Prior{Point3d{}}, Information(Mat6d::identity()), point)'
expect not_a_residual "no matching function" 'edit.add(NotAResidual{1.0}, Sigma(1.0), pose)'
expect not_a_variable "no matching function" 'edit.add(NoName{})'

[ $failures -eq 0 ] && echo "all compile errors are clear"
exit $failures
