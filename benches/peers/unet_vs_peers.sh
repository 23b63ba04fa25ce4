#!/usr/bin/env bash
# Times training and prediction: trodden against PyTorch (channels_last, with its allocator as it comes and tuned), in turn.
#
#   benches/peers/unet_vs_pytorch.sh [ROUNDS] [SECONDS]
#
# Installs PyTorch into an environment of its own in a temporary folder, unless TORCH_PYTHON names a Python that has it.
# Prints samples per second and peak memory, medians over ROUNDS rounds, and the ratio to PyTorch at its best.
set -euo pipefail
rounds=${1:-5} seconds=${2:-5}
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

python=${TORCH_PYTHON:-}
if [ -z "$python" ]; then
  python3 -m venv "$work/torch"
  "$work/torch/bin/pip" install --quiet --disable-pip-version-check torch numpy
  python=$work/torch/bin/python
fi
bench=${TRODDEN_UNET_BENCH:-}
if [ -z "$bench" ]; then
  bench=$(cd "$root" && cargo bench --bench unet --no-run --message-format=json 2>/dev/null |
    "$python" -c 'import json, sys
for line in sys.stdin:
    message = json.loads(line)
    if message.get("target", {}).get("name") == "unet" and message.get("executable"):
        print(message["executable"])')
fi

measure() { # name, mode, threads, command...
  local name=$1 mode=$2 threads=$3
  shift 3
  printf '{"name": "%s", "threads": %s, "result": %s}\n' "$name" "$threads" "$("$@")" >> "$work/results.jsonl"
}

for _ in $(seq "$rounds"); do
  for mode in train infer; do
    for threads in 1 2; do
      torch=("$python" "$here/unet_torch.py" "$mode" "$seconds" "$threads")
      export OMP_NUM_THREADS=$threads RAYON_NUM_THREADS=$threads
      measure pytorch "$mode" "$threads" "${torch[@]}"
      measure "pytorch, tuned" "$mode" "$threads" env \
        MALLOC_TOP_PAD_=4000000000 MALLOC_MMAP_THRESHOLD_=4000000000 MALLOC_TRIM_THRESHOLD_=4000000000 "${torch[@]}"
      measure trodden "$mode" "$threads" "$bench" --peer "$mode" "$seconds"
    done
  done
done

"$python" - "$work/results.jsonl" <<'PY'
import collections, json, statistics, sys

runs = collections.defaultdict(list)
for line in open(sys.argv[1]):
    run = json.loads(line)
    runs[run["result"]["mode"], run["threads"], run["name"]].append(run["result"])
median = lambda key, what: statistics.median(run[what] for run in runs[key])
print(f"{'':24}{'samples/s':>12}{'peak MB':>10}{'times PyTorch at its best':>28}")
for mode, threads in sorted({key[:2] for key in runs}, reverse=True):
    best = max(median((mode, threads, name), "samples_per_s") for name in ("pytorch", "pytorch, tuned"))
    print(f"{mode}, {threads} thread{'s' if threads > 1 else ''}")
    for name in ("pytorch", "pytorch, tuned", "trodden"):
        rate, peak = (median((mode, threads, name), what) for what in ("samples_per_s", "peak_mb"))
        print(f"  {name:22}{rate:12.0f}{peak:10.0f}{rate / best:28.2f}")
PY
