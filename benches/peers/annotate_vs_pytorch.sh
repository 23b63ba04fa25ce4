#!/usr/bin/env bash
# Times the sliding windows of algorithm 1: `trodden annotate --mode exact` against the same windows in PyTorch, in turn.
#
#   cargo build --release && benches/peers/annotate_vs_pytorch.sh MAP MODEL [STRIDE] [ROUNDS]
#
# MAP is what `trodden annotate` reads, MODEL a checkpoint's folder. Installs PyTorch into an environment of its own in a
# temporary folder, unless TORCH_PYTHON names a Python that has torch, pyarrow, pandas and safetensors. Prints seconds,
# medians over ROUNDS rounds: of the whole command for trodden, of the windows alone, without start and reading, for PyTorch
# (channels_last, allocator tuned); and by how much the two heat maps differ at most.
set -euo pipefail
map=${1:?a map} model=${2:?the folder of a checkpoint} stride=${3:-1} rounds=${4:-5}
here=$(cd "$(dirname "$0")" && pwd)
trodden=${TRODDEN_BIN:-$here/../../target/release/trodden}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

python=${TORCH_PYTHON:-}
if [ -z "$python" ]; then
  python3 -m venv "$work/torch"
  "$work/torch/bin/pip" install --quiet --disable-pip-version-check torch numpy pandas pyarrow safetensors
  python=$work/torch/bin/python
fi

export OMP_NUM_THREADS=2 RAYON_NUM_THREADS=2
for _ in $(seq "$rounds"); do
  start=${EPOCHREALTIME/./}
  "$trodden" annotate "$map" --model "$model" --out "$work/out" --mode exact --stride "$stride" >/dev/null
  printf '{"name": "trodden", "seconds": %se-6}\n' $((${EPOCHREALTIME/./} - start)) | tee -a "$work/results.jsonl" >&2
  env MALLOC_TOP_PAD_=4000000000 MALLOC_MMAP_THRESHOLD_=4000000000 MALLOC_TRIM_THRESHOLD_=4000000000 \
    "$python" "$here/annotate_torch.py" "$work/out" "$model" "$stride" | tee -a "$work/results.jsonl" >&2
done

"$python" - "$work/results.jsonl" <<'PY'
import json, statistics, sys

runs = [json.loads(line) for line in open(sys.argv[1])]
seconds = {name: [run["seconds"] for run in runs if run["name"] == name] for name in ("pytorch", "trodden")}
last = next(run for run in runs if run["name"] == "pytorch")
print(f"{last['windows']} windows; heat differs by {max(run.get('differs', 0) for run in runs):.1e} at most")
for name, times in seconds.items():
    print(f"{name:10}{statistics.median(times):10.2f} s, median of {len(times)}: {min(times):.2f} to {max(times):.2f}")
print(f"times PyTorch {statistics.median(seconds['pytorch']) / statistics.median(seconds['trodden']):.2f}")
PY
