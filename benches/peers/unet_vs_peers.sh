#!/usr/bin/env bash
# Times training and prediction: trodden against PyTorch (channels_last, with its allocator as it comes and tuned), and
# prediction against ONNX Runtime and OpenVINO, all in turn, for the paper's network and the one that trodden brings.
#
#   benches/peers/unet_vs_peers.sh [ROUNDS] [SECONDS] [avx512|avx2]
#
# Installs the peers into an environment of its own in a temporary folder, unless PEERS_PYTHON names a Python that has them.
# With `avx2`, trodden, PyTorch and OpenVINO are told to do without AVX-512; ONNX Runtime cannot be told. Prints samples per
# second and peak memory, medians over ROUNDS rounds, and the ratio to the fastest peer.
set -euo pipefail
rounds=${1:-5} seconds=${2:-5} simd=${3:-}
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

python=${PEERS_PYTHON:-}
if [ -z "$python" ]; then
  python3 -m venv "$work/peers"
  "$work/peers/bin/pip" install --quiet --disable-pip-version-check torch numpy onnx onnxscript onnxruntime openvino
  python=$work/peers/bin/python
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
if [ -n "$simd" ]; then
  export TRODDEN_SIMD=$simd
fi
if [ "$simd" = avx2 ]; then
  # PyTorch's own kernels, and oneDNN's in PyTorch and in OpenVINO.
  export ATEN_CPU_CAPABILITY=avx2 ONEDNN_MAX_CPU_ISA=AVX2 DNNL_MAX_CPU_ISA=AVX2 OV_CPU_MAX_ISA=AVX2
fi

measure() { # name, network, mode, threads, command...
  local name=$1 network=$2 mode=$3 threads=$4
  shift 4
  printf '{"name": "%s", "network": "%s", "threads": %s, "result": %s}\n' \
    "$name" "$network" "$threads" "$("$@" 2>> "$work/errors")" >> "$work/results.jsonl"
}

for _ in $(seq "$rounds"); do
  for network in paper shipped; do
    for mode in train infer; do
      for threads in 1 2; do
        torch=("$python" "$here/unet_torch.py" "$mode" "$seconds" "$threads" "$network")
        export OMP_NUM_THREADS=$threads RAYON_NUM_THREADS=$threads
        measure pytorch "$network" "$mode" "$threads" "${torch[@]}"
        measure "pytorch, tuned" "$network" "$mode" "$threads" env \
          MALLOC_TOP_PAD_=4000000000 MALLOC_MMAP_THRESHOLD_=4000000000 MALLOC_TRIM_THRESHOLD_=4000000000 "${torch[@]}"
        if [ "$mode" = infer ]; then
          for runtime in onnxruntime openvino; do
            measure "$runtime" "$network" "$mode" "$threads" \
              "$python" "$here/unet_onnx.py" "$runtime" "$seconds" "$threads" "$network"
          done
        fi
        measure trodden "$network" "$mode" "$threads" "$bench" --peer "$mode" "$seconds" "$network"
      done
    done
  done
done

"$python" - "$work/results.jsonl" <<'PY'
import collections, json, statistics, sys

runs = collections.defaultdict(list)
for line in open(sys.argv[1]):
    run = json.loads(line)
    runs[run["network"], run["result"]["mode"], run["threads"], run["name"]].append(run["result"])
median = lambda key, what: statistics.median(run[what] for run in runs[key])
print(f"{'':24}{'samples/s':>12}{'peak MB':>10}{'trodden is so many times as fast':>36}")
for case in sorted({key[:3] for key in runs}, key=lambda case: (case[0], case[1] != "train", case[2])):
    network, mode, threads = case
    names = [key[3] for key in runs if key[:3] == case]
    print(f"{network}: {mode}, {threads} thread{'s' if threads > 1 else ''}")
    for name in dict.fromkeys(names):
        rate, peak = (median((*case, name), what) for what in ("samples_per_s", "peak_mb"))
        times = "" if name == "trodden" else f"{median((*case, 'trodden'), 'samples_per_s') / rate:.2f}"
        print(f"  {name:22}{rate:12.0f}{peak:10.0f}{times:>36}")
PY
