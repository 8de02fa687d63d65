"""What game engines can run: the operators of an exported graph against their tables.

Unity's table is that of its manual, page "Supported ONNX operators" of Sentis 2.1, read on
2026-11-23; later versions (Inference Engine 2.2 to 2.6) add to it:
https://docs.unity3d.com/Packages/com.unity.sentis@2.1/manual/supported-operators.html
Opsets 7 to 15, and tensors of at most eight dimensions: page "Supported models" of Sentis 2.0,
2026-11-23. Sentis 2.6 takes opsets up to 25.

Unreal has no separate table: its runtimes NNERuntimeORTCpu and NNERuntimeORTDml are ONNX Runtime,
which runs every operator of ONNX's own domain of opsets 7 and later on the CPU
(docs/Versioning.md and docs/OperatorKernels.md of microsoft/onnxruntime, 2026-11-23). The exporter
therefore opens and runs each file with ONNX Runtime, on the CPU alone.
"""

from typing import Final

import onnx

from wayfarer.errors import ArtifactError
from wayfarer_lab.engine_export.graph import operators

MAX_DIMENSIONS: Final = 8
"""Maximum rank of a tensor in Unity."""

SENTIS: Final = {
    "Abs", "Acos", "Acosh", "Add", "And", "ArgMax", "ArgMin", "Asin", "Asinh", "Atan", "Atanh",
    "AveragePool", "BatchNormalization", "Bernoulli", "Cast", "CastLike", "Ceil", "Celu",
    "Clip", "Concat", "Constant", "ConstantOfShape", "Conv", "ConvTranspose", "Cos", "Cosh",
    "CumSum", "DepthToSpace", "Div", "Dropout", "Elu", "Equal", "Erf", "Exp", "Expand",
    "Flatten", "Floor", "Gather", "GatherElements", "GatherND", "Gemm", "GlobalAveragePool",
    "GlobalMaxPool", "Greater", "GreaterOrEqual", "GridSample", "Hardmax", "HardSigmoid",
    "HardSwish", "Identity", "InstanceNormalization", "IsInf", "IsNaN", "LayerNormalization",
    "LeakyRelu", "Less", "LessOrEqual", "Log", "LogSoftmax", "MatMul", "Max", "MaxPool",
    "Mean", "Min", "Mod", "Mul", "Neg", "Not", "OneHot", "Or", "Pad", "Pow", "PRelu",
    "RandomNormal", "RandomNormalLike", "RandomUniform", "RandomUniformLike", "Range",
    "Reciprocal", "ReduceL1", "ReduceL2", "ReduceLogSum", "ReduceLogSumExp", "ReduceMax",
    "ReduceMean", "ReduceMin", "ReduceProd", "ReduceSum", "ReduceSumSquare", "Relu", "Reshape",
    "Resize", "RoiAlign", "Round", "Scatter", "ScatterElements", "ScatterND", "Selu", "Shape",
    "Shrink", "Sigmoid", "Sign", "Sin", "Sinh", "Size", "Slice", "Softmax", "Softplus",
    "Softsign", "SpaceToDepth", "Split", "Sqrt", "Squeeze", "Sub", "Sum", "Tan", "Tanh",
    "ThresholdedRelu", "Tile", "Transpose", "Trilu", "Unsqueeze", "Upsample", "Where", "Xor",
}  # fmt: skip
"""Operators that all three of Unity's backends have (CPU, GPUCompute, GPUPixel). Left out are those
that one of them lacks: Compress, Einsum, LRN, LSTM, Multinomial, NonMaxSuppression, NonZero, TopK.
"""


def check_operators(model: onnx.ModelProto, name: str) -> None:
    """Raises ArtifactError that names what an engine cannot run."""
    foreign = sorted({node.domain for node in model.graph.node} - {"", "ai.onnx"})
    if foreign:
        raise ArtifactError(f"{name}: operators of the domains {foreign}; engines have ONNX's own")
    if missing := sorted(set(operators(model)) - SENTIS):
        raise ArtifactError(f"{name}: Unity's Inference Engine has no {', '.join(missing)}")
    inferred = onnx.shape_inference.infer_shapes(model).graph
    for value in (*inferred.input, *inferred.value_info, *inferred.output):
        if (rank := len(value.type.tensor_type.shape.dim)) > MAX_DIMENSIONS:
            raise ArtifactError(
                f"{name}: {value.name} has {rank} dimensions; Unity takes {MAX_DIMENSIONS}"
            )
