#!/usr/bin/env bash
# Installs what Strata needs on Debian 12, from a pristine system on. May be run again: it does nothing when all is there.
#   deploy/install-deps.sh            build, run and test
#   deploy/install-deps.sh --lint     the linters, sanitizer runtimes and valgrind that .ci/run uses
#   deploy/install-deps.sh --runtime  only what the installed programs need to run
#   deploy/install-deps.sh --list     print the package names and do nothing
set -euo pipefail

# libprotobuf-dev and protobuf-compiler are named because libgrpc++-dev does not bring them.
build=(
  ca-certificates git g++ cmake ninja-build ccache pkg-config python3
  libgrpc++-dev libgrpc-dev libprotobuf-dev protobuf-compiler protobuf-compiler-grpc
  libeigen3-dev libtbb-dev libspdlog-dev libcli11-dev nlohmann-json3-dev libyaml-cpp-dev libsqlite3-dev prometheus-cpp-dev
  zlib1g-dev libzstd-dev libssl-dev
  libgtest-dev libgmock-dev libbenchmark-dev python3-grpcio python3-protobuf
)
lint=(clang-19 clang-tidy-19 clang-format-19 libclang-rt-19-dev shellcheck valgrind)
# Each line belongs to the -dev package of the same library above.
runtime=(
  ca-certificates libgrpc++1.51 libprotobuf32 libtbb12 libspdlog1.10 libyaml-cpp0.7 libsqlite3-0
  libprometheus-cpp-core1.0 libprometheus-cpp-pull1.0 zlib1g libzstd1 libssl3
)

packages=("${build[@]}")
only_list=0
for argument in "$@"; do
  case $argument in
    --lint) packages+=("${lint[@]}") ;;
    --runtime) packages=("${runtime[@]}") ;;
    --list) only_list=1 ;;
    *) echo "install-deps: unknown option $argument (know --lint, --runtime, --list)" >&2; exit 2 ;;
  esac
done
if [ "$only_list" = 1 ]; then printf '%s\n' "${packages[@]}"; exit 0; fi

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query -W -f '${Status}' "$package" 2>/dev/null || true)
  [ "$status" = 'install ok installed' ] || missing+=("$package")
done
if [ ${#missing[@]} -eq 0 ]; then
  echo "install-deps: all ${#packages[@]} packages are installed"
  exit 0
fi

as_root=()
if [ "$(id -u)" != 0 ]; then
  command -v sudo >/dev/null || { echo "install-deps: run as root, or install sudo; missing: ${missing[*]}" >&2; exit 1; }
  as_root=(sudo)
fi
echo "install-deps: installing ${#missing[@]} packages"
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
echo "install-deps: done"
