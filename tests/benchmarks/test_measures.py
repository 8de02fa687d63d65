"""Figures that benchmarks compute from measurements, with small engines and hand-made runs."""

import argparse
import asyncio
import time

import pytest
from benchmarks.flops import Product
from benchmarks.models import opened

from benchmarks import disturbance, gemm, paper_s3, service, simulated, step, transport
from wayfarer.spec import STEP_SECONDS
from wayfarer_lab.load.knee import FAULTS
from wayfarer_lab.load.plan import LoadPlan


def test_the_ceiling_is_the_best_of_all_libraries():
    rows = [
        {"precision": "fp32", "threads": 1, "gflops": 80.0},
        {"precision": "fp32", "threads": 1, "gflops": 100.0},
        {"precision": "fp32", "threads": 2, "gflops": 190.0},
    ]
    assert gemm.ceilings(rows) == {("fp32", 1): 100.0, ("fp32", 2): 190.0}


def test_products_of_both_libraries_are_timed(monkeypatch):
    monkeypatch.setattr(gemm, "LARGE", (32,))
    rows = gemm.measure([1], [Product(8, 16, 4, count=3), Product(32, 16, 4)], 0.01)
    assert {(r["library"], r["precision"]) for r in rows} == {
        ("torch", "fp32"),
        ("torch", "bf16"),
        ("onnxruntime", "fp32"),
    }
    assert {r["products"] for r in rows} == {"large 32", "ours"}
    assert all(r["gflops"] > 0 for r in rows)


def test_a_step_is_held_against_its_products_at_the_ceiling(monkeypatch):
    monkeypatch.setattr(
        step, "products", lambda graph, agents, candidates: [Product(agents, 500, 1000)]
    )
    rows = [step.row("engine", 128, 1, 1, seconds=2e-3)]
    step.beside_ceiling(rows, {("fp32", 1): 128.0, ("bf16", 1): 256.0}, graph=None)
    # 128 agents of 1 MFLOP at 128 GFLOP/s: 1 ms
    assert rows[0]["mflop"] == pytest.approx(1.0)
    assert rows[0]["of_gemm"] == pytest.approx(2.0)
    assert rows[0]["of_bf16"] == pytest.approx(4.0)
    assert rows[0]["real_time"] == 128 * 100
    (found,) = step.ratios(rows, []).values()
    assert found == {"value": 2.0, "better": "lower"}


class LinearEngine:
    """Takes a fixed time for each agent and for each call."""

    def __init__(self, per_agent, per_call=0.0):
        self._per_agent, self._per_call = per_agent, per_call

    def step(self, gender, inputs):
        until = time.perf_counter() + self._per_call + self._per_agent * len(inputs.goal)
        while time.perf_counter() < until:
            pass


def test_table_s3_ends_once_a_primitive_takes_longer_than_it_lasts(monkeypatch):
    monkeypatch.setattr(paper_s3, "CALL_SIZES", (8, 64))
    monkeypatch.setattr(paper_s3, "PAPER_SECONDS", {64: 0.1, 128: 0.15})
    rows = paper_s3.table(LinearEngine(STEP_SECONDS / 200), spend=0.0)
    assert [row["bodies"] for row in rows] == [64, 128, 256]
    assert [row["in_real_time"] for row in rows] == [True, True, False]
    assert rows[0]["paper / ours"] > 1
    assert rows[2]["paper / ours"] is None


def summary(agents, misses=0):
    return dict.fromkeys(FAULTS, 0) | {
        "agents": agents,
        "misses": misses,
        "lateness_ms": {"p99": 10.0},
    }


@pytest.mark.parametrize(("limit", "held"), [(100, 100), (96, 95), (10, 90)])
def test_a_long_run_is_made_again_with_fewer_until_all_are_in_time(monkeypatch, limit, held):
    def loaded(plan, environment, command):
        return summary(plan.agents, misses=max(plan.agents - limit, 0))

    monkeypatch.setattr(service, "loaded", loaded)
    found = service.held(LoadPlan(sessions=1, agents=100), 1, ("serve",))
    assert found["agents"] == held
    assert service.in_time(found, 50.0) == (limit != 10)  # it gives up after a few tries


def test_a_bare_socket_brings_all_and_costs_something():
    cores = asyncio.run(transport.bare_socket(100_000, 0.3))
    assert 0 < cores < 2


def over_time(*late_ms, missed=()):
    """Rows of 0.2 s each, of ten primitives."""
    return [
        {"at": 0.2 * k, "due": 10, "missed": 10 * (k in missed), "mean_ms": 0.0, "max_ms": late}
        for k, late in enumerate(late_ms)
    ]


def test_a_server_is_back_when_a_second_on_time_begins():
    calm = over_time(*[1.0] * 20)
    assert disturbance.back_after(calm, 1.0) == 0.0
    slow = over_time(*[1.0] * 5, *[300.0] * 4, 1.0, 80.0, *[1.0] * 10, missed=(5, 6))
    assert disturbance.back_after(slow, 1.0) == pytest.approx(1.2), "the one of 80 ms counts"
    never = over_time(*[1.0] * 5, *[300.0] * 10)
    assert disturbance.back_after(never, 1.0) is None


def test_the_figures_of_a_disturbance_are_told_by_ring():
    near = {"over_time": over_time(*[0.0] * 20), "lateness_ms": {"p99": 3.0}}
    far = {"over_time": over_time(*[0.0] * 20, missed=(6,)), "lateness_ms": {"p99": 9.0}}
    empty = {"over_time": [], "lateness_ms": None}
    rings = [
        {"ring": name, "people": 10.0, "held": 0, "reduced": 0, **figures}
        for name, figures in (("full:8", near), ("root", far), ("part:9", empty))
    ]
    found = disturbance.ring_rows("stall", {"rings": rings}, disturbance.Span(1.0, 2.0))
    assert [row["ring"] for row in found] == ["full:8", "root", "part:9"]
    assert [row["within"] for row in found] == [0, 10, 0]
    assert [row["back_s"] for row in found] == [0.0, 0.0, None]


def test_misses_are_counted_by_when_they_were_due():
    rows = over_time(*[0.0] * 20, missed=(4, 5, 6, 12))
    counted = [disturbance.missed(rows, *span) for span in ((0, 1), (1, 2), (2, 9))]
    assert counted == [10, 20, 10]


def test_a_simulated_engine_has_the_batches_of_the_real_one():
    real = opened("onnxruntime", 2)
    assert simulated.batches("onnxruntime", 2) == (real.batch_sizes, real.full)
    sizes, full = simulated.batches("openvino", 2)
    assert sizes[-1] >= 2 * full == 256


def test_a_simulated_machine_is_late_only_when_it_has_too_much_to_do():
    def run(agents, **changed):
        values = {"seconds": 2.0, "slower": 1.0, "stall": 0.0, "phases": 2, "depth": 2, "cores": 2}
        values |= {"call": (3.0, 0.235), "engine": "onnxruntime"}
        return simulated.simulated(agents, argparse.Namespace(**(values | changed)))

    once, again = run(64), run(64)
    assert once == again, "no clock of this machine counts"
    assert once["missed"] == 0 and once["normal_p99"] == 0 and once["level"] == 0
    assert 0 < once["engine_busy"] < 0.5 and once["rounds"] == pytest.approx(2, abs=0.2)
    slow = run(64, slower=8.0)
    assert slow["normal_p99"] > 20 and slow["engine_busy"] > 0.6 and slow["level"] > 0
