"""Predicts with the network of src/domain/unet in ONNX Runtime or OpenVINO and prints one line of JSON.

    python unet_onnx.py onnxruntime|openvino SECONDS THREADS [paper|shipped]

Batches of 32 windows of 64 x 64 cells, f32. The model is exported from PyTorch (initializers in it, one shape) beside this run.
"""

import json
import os
import resource
import sys
import tempfile
import time

import numpy as np
import torch

from unet import NETWORKS, Said, UNet

runtime, seconds, threads = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
name = sys.argv[4] if len(sys.argv) > 4 else "paper"
torch.manual_seed(0)
BATCH, SIZE = 32, 64
planes, outputs = NETWORKS[name]
said = Said(UNet(planes, outputs), name).eval()
shown = (torch.rand(BATCH, planes, SIZE, SIZE) > 0.5).float()
with tempfile.TemporaryDirectory() as folder:
    path = os.path.join(folder, "unet.onnx")
    torch.onnx.export(said, (shown,), path, input_names=["x"], output_names=["y"], dynamo=False)
    with torch.inference_mode():
        expected = said(shown).numpy()
    x = shown.numpy()
    if runtime == "onnxruntime":
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
        session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        step = lambda: session.run(None, {"x": x})[0]
    else:
        import openvino

        core = openvino.Core()
        settings = {"INFERENCE_NUM_THREADS": threads, "INFERENCE_PRECISION_HINT": "f32", "PERFORMANCE_HINT": "LATENCY"}
        compiled = core.compile_model(core.read_model(path), "CPU", settings)
        step = lambda: compiled([x])[0]
    worst = float(np.abs(step() - expected).max())
    assert worst < 1e-4, worst

for _ in range(3):
    step()
times, start = [], time.perf_counter()
while len(times) < 6 or time.perf_counter() - start < seconds:
    before = time.perf_counter()
    step()
    times.append(time.perf_counter() - before)
rate = BATCH / sorted(times)[len(times) // 2]
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({"mode": "infer", "samples_per_s": round(rate, 1), "peak_mb": round(peak)}))
