"""The precision of trainings that only need a processor."""

import torch


def half_precision() -> torch.autocast:
    """Matrix products in bfloat16 where the CPU computes in it, otherwise in float32.

    Without AVX-512, torch emulates bfloat16: a policy's update took 12 times as long as in float32
    and a step of the simulation 4 times (AMD EPYC without AVX-512, torch 2.13).
    """
    return torch.autocast("cpu", dtype=torch.bfloat16, enabled=_computes_in_bfloat16())


def _computes_in_bfloat16() -> bool:
    return torch.cpu._is_avx512_bf16_supported()
