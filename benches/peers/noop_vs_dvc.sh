#!/usr/bin/env bash
# Times a run with nothing to do: trodden against `dvc repro`, on pipelines of about the same number of nodes, in turn.
#
#   cargo build --release && benches/peers/noop_vs_dvc.sh [MAPS] [ROUNDS]
#
# Installs DVC into an environment of its own in a temporary folder. MAPS = 60 gives 300 nodes.
set -euo pipefail
maps=${1:-60} rounds=${2:-5}
root=$(cd "$(dirname "$0")/../.." && pwd)
trodden=${TRODDEN_BIN:-$root/target/release/trodden}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

python3 -m venv dvc
dvc/bin/pip install --quiet --disable-pip-version-check dvc

# Five nodes a map: the map, its walks with one chunk, its visits with one chunk.
cat > small.yaml <<YAML
seed: 1
maps:
  all: { homes: { count: $maps, area: [50, 60] } }
stages:
  walks: { use: simulate, map: \$maps, episodes: 1, agents: [1, 1], duration: 2 }
  visits: { use: rasterize, map: \$maps, walks: walks }
YAML
nodes=$((maps * 5))

# The same shape: chains of five stages, each with a parameter, a dependency and an output.
mkdir repo && cd repo
git init -q . && ../dvc/bin/dvc init -q
python3 - "$maps" <<'PY'
import sys
maps = int(sys.argv[1])
lines = ["stages:"]
for m in range(maps):
    for s in range(5):
        lines += [f"  s{m}_{s}:", f"    cmd: echo {m} {s} > o{m}_{s}"]
        if s:
            lines += ["    deps:", f"      - o{m}_{s-1}"]
        lines += ["    outs:", f"      - o{m}_{s}"]
open("dvc.yaml", "w").write("\n".join(lines) + "\n")
PY
../dvc/bin/dvc repro -q
cd ..
"$trodden" --store store run small.yaml --quiet

for _ in $(seq "$rounds"); do
  # The shell's own clock: starting a program to ask for the time would take longer than what is timed.
  a=$EPOCHREALTIME; "$trodden" --store store run small.yaml --quiet; b=$EPOCHREALTIME
  (cd repo && ../dvc/bin/dvc repro -q); c=$EPOCHREALTIME
  echo "$a $b $c"
done | python3 -c '
import sys, statistics
rows = [list(map(float, line.split())) for line in sys.stdin]
ours = statistics.median(b - a for a, b, c in rows)
dvc = statistics.median(c - b for a, b, c in rows)
ratio = statistics.median((c - b) / (b - a) for a, b, c in rows)
print(f"nothing to do, '"$nodes"' nodes: trodden {ours * 1e3:.0f} ms, dvc {dvc * 1e3:.0f} ms, {ratio:.0f} times faster (medians of {len(rows)})")'
