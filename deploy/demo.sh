#!/usr/bin/env bash
# On a fresh Debian 12: installs what is needed, builds, starts stratad, meshes the shipped rocket with boundary layers through strata over
# gRPC, and shows the result. Leaves build/demo/rocket.vtu (open it in ParaView) and build/demo/report.json.
#   deploy/demo.sh          about 200 thousand hexes
#   deploy/demo.sh large    about 2 million
set -euo pipefail
cd "$(dirname "$0")/.."
spec=bench/shapes/rocket.json
[ "${1:-}" = large ] && spec=bench/shapes/rocket.large.json

bash deploy/install-deps.sh
bash deploy/build.sh release stratad strata strata_shapes
bin=$PWD/build/release/bin
out=$PWD/build/demo
mkdir -p "$out"
"$bin/strata_shapes" rocket "$out/rocket.stl"

folder=$(mktemp -d)
address=unix:$folder/stratad.sock
"$bin/stratad" --listen "$address" --slots 1 --data-dir "$folder/data" >"$out/stratad.log" 2>&1 &
server=$!
stop() {
  kill -TERM "$server" 2>/dev/null || true
  wait "$server" || true
  rm -rf "$folder"
}
trap stop EXIT
for _ in $(seq 100); do
  "$bin/strata" server status --server "$address" >/dev/null 2>&1 && break
  kill -0 "$server" 2>/dev/null || { echo "demo: stratad did not start:" >&2; cat "$out/stratad.log" >&2; exit 1; }
  sleep 0.1
done

"$bin/strata" mesh "$out/rocket.stl" --spec "$spec" --server "$address" -o "$out/rocket.vtu" --report "$out/report.json"
echo "mesh:   build/demo/rocket.vtu"
echo "report: build/demo/report.json"
