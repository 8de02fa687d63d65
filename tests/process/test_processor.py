"""Cores by affinity and by the quotas of control groups, in made folders."""

import pytest

from wayfarer.process import processor
from wayfarer.process.processor import cores

V2 = "31 24 0:26 / /sys/fs/cgroup rw,nosuid - cgroup2 cgroup2 rw,nsdelegate\n"
V1 = "33 30 0:29 / /sys/fs/cgroup/cpu,cpuacct rw shared:9 - cgroup cgroup rw,cpu,cpuacct\n"
V1_MEMORY = "34 30 0:30 / /sys/fs/cgroup/memory rw shared:9 - cgroup cgroup rw,memory\n"


@pytest.fixture(autouse=True)
def sixteen(monkeypatch):
    monkeypatch.setattr(processor, "core_numbers", lambda: list(range(16)))


class Machine:
    def __init__(self, root, group, mounts):
        self.root = root
        self.put("proc/self/cgroup", group)
        self.put("proc/self/mountinfo", mounts)

    def put(self, path, text):
        file = self.root / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("max 100000", 16),
        ("50000 100000", 1),
        ("100000 100000", 1),
        ("150000 100000", 2),
        ("400000 100000", 4),
        ("6400000 100000", 16),
        ("1000 100000", 1),
        ("nonsense", 16),
        ("", 16),
    ],
)
def test_a_quota_of_version_2(tmp_path, text, count):
    machine = Machine(tmp_path, "0::/\n", V2)
    machine.put("sys/fs/cgroup/cpu.max", text)
    assert cores(tmp_path) == count


@pytest.mark.parametrize(
    ("quota", "period", "count"),
    [("-1", "100000", 16), ("50000", "100000", 1), ("250000", "100000", 3), ("20000", "10000", 2)],
)
def test_a_quota_of_version_1(tmp_path, quota, period, count):
    machine = Machine(tmp_path, "5:memory:/x\n4:cpu,cpuacct:/\n", V1_MEMORY + V1)
    machine.put("sys/fs/cgroup/cpu,cpuacct/cpu.cfs_quota_us", quota)
    machine.put("sys/fs/cgroup/cpu,cpuacct/cpu.cfs_period_us", period)
    assert cores(tmp_path) == count


def test_groups_above_count_as_well(tmp_path):
    machine = Machine(tmp_path, "0::/user.slice/pod/container\n", V2)
    machine.put("sys/fs/cgroup/user.slice/pod/container/cpu.max", "800000 100000")
    assert cores(tmp_path) == 8
    machine.put("sys/fs/cgroup/user.slice/pod/cpu.max", "max 100000")
    machine.put("sys/fs/cgroup/user.slice/cpu.max", "300000 100000")
    assert cores(tmp_path) == 3


def test_a_container_sees_its_own_group_as_the_root(tmp_path):
    """Version 1 without a namespace: the group of the host is what is mounted."""
    mount = V1.replace("0:29 / /sys", "0:29 /docker/4f /sys")
    machine = Machine(tmp_path, "4:cpu,cpuacct:/docker/4f/inner\n", mount)
    machine.put("sys/fs/cgroup/cpu,cpuacct/cpu.cfs_period_us", "100000")
    machine.put("sys/fs/cgroup/cpu,cpuacct/cpu.cfs_quota_us", "200000")
    assert cores(tmp_path) == 2
    machine.put("sys/fs/cgroup/cpu,cpuacct/inner/cpu.cfs_period_us", "100000")
    machine.put("sys/fs/cgroup/cpu,cpuacct/inner/cpu.cfs_quota_us", "100000")
    assert cores(tmp_path) == 1
    machine.put("proc/self/cgroup", "4:cpu,cpuacct:/elsewhere\n")
    assert cores(tmp_path) == 2


def test_both_versions_at_a_time(tmp_path):
    machine = Machine(
        tmp_path,
        "4:cpu,cpuacct:/\n0::/\n",
        V1 + V2.replace("/sys/fs/cgroup", "/sys/fs/cgroup\\040unified"),
    )
    machine.put("sys/fs/cgroup unified/cpu.max", "500000 100000")
    assert cores(tmp_path) == 5
    machine.put("sys/fs/cgroup/cpu,cpuacct/cpu.cfs_period_us", "100000")
    machine.put("sys/fs/cgroup/cpu,cpuacct/cpu.cfs_quota_us", "400000")
    assert cores(tmp_path) == 4


def test_the_affinity_counts_when_it_is_smaller(tmp_path, monkeypatch):
    monkeypatch.setattr(processor, "core_numbers", lambda: [3, 7])
    machine = Machine(tmp_path, "0::/\n", V2)
    machine.put("sys/fs/cgroup/cpu.max", "800000 100000")
    assert cores(tmp_path) == 2


def test_without_control_groups_the_affinity_counts(tmp_path):
    assert cores(tmp_path) == 16
    assert cores() >= 1
