"""Predicts with the network of src/domain/unet in ONNX Runtime or OpenVINO and prints one line of JSON.

    python unet_onnx.py onnxruntime|openvino SECONDS THREADS [paper|shipped]

Batches of 32 windows of 64 x 64 cells, f32. The model is exported from PyTorch (initializers in it, one shape) beside this run.
"""

import os
import sys
import tempfile

import numpy as np
import torch

from unet import NETWORKS, Said, UNet, report

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

report("infer", step, BATCH, seconds)
