#!/usr/bin/env bash
# Configures and builds a preset: deploy/build.sh PRESET [TARGET...]. ccache serves repeated builds, whatever folder the checkout is in.
set -euo pipefail
cd "$(dirname "$0")/.."
preset=${1:?usage: deploy/build.sh PRESET [TARGET...]}
shift
export CCACHE_BASEDIR=$PWD CCACHE_NOHASHDIR=1
log=$(cmake --preset "$preset" 2>&1) || { echo "$log" >&2; exit 1; }
cmake --build "build/$preset" --parallel "${STRATA_BUILD_JOBS:-$(nproc)}" ${1:+--target "$@"}
