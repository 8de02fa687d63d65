import torch

from wayfarer_lab.training import precision
from wayfarer_lab.training.precision import half_precision


def product() -> torch.Tensor:
    with half_precision():
        return torch.ones(4, 4) @ torch.ones(4, 4)


def test_bfloat16_is_used_only_where_the_processor_computes_in_it(monkeypatch):
    monkeypatch.setattr(precision, "_computes_in_bfloat16", lambda: True)
    assert product().dtype == torch.bfloat16
    monkeypatch.setattr(precision, "_computes_in_bfloat16", lambda: False)
    assert product().dtype == torch.float32
