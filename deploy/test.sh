#!/usr/bin/env bash
# On a fresh Debian 12: installs what is needed, builds, and passes all tests.
# Tests labelled "long" are left to those who ask: ctest --test-dir build/release -L long
set -euo pipefail
cd "$(dirname "$0")/.."
bash deploy/install-deps.sh
bash deploy/build.sh release
ctest --test-dir build/release --parallel "${STRATA_TEST_JOBS:-2}" --label-exclude long --schedule-random --output-on-failure --no-tests=error
