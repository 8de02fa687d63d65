"""A command's requests to the system: hosts that it looks up or calls, and files that it writes."""

import re
from dataclasses import dataclass
from pathlib import Path

CALLS = (
    "connect,sendto,sendmsg,sendmmsg,open,openat,creat,mkdir,mkdirat,mknod,mknodat,"
    "rename,renameat,renameat2,link,linkat,symlink,symlinkat"
)
ON_THIS_MACHINE = re.compile(r'inet_addr\("127\.|"::1"|"::ffff:127\.')
NAME_SERVICE = re.compile(r"htons\(53\)|nscd|systemd/resolve|avahi")


def strace(record: Path) -> list[str]:
    """What to put before a command. The command stays the child, and strace ends after it."""
    return ["strace", "-D", "-f", "-qq", "--seccomp-bpf", f"--trace={CALLS}", "-o", str(record)]


@dataclass(frozen=True)
class Asked:
    """The requests to the system."""

    hosts: list[str]  # calls that leave this machine, or ask for the address of a name
    written: set[str]  # files and folders that were made, or opened for writing


def asked(record: Path) -> Asked:
    """What strace wrote down. Raises AssertionError when that is nothing."""
    lines = [re.sub(r"^\d+ +", "", line) for line in record.read_text().splitlines()]
    assert lines, f"strace wrote nothing into {record}"
    hosts, written = [], set()
    for line in lines:
        name = line.partition("(")[0]
        if name in ("connect", "sendto", "sendmsg", "sendmmsg"):
            leaves = "sa_family=AF_INET" in line and not ON_THIS_MACHINE.search(line)
            if leaves or NAME_SERVICE.search(line):
                hosts.append(line)
            continue
        resumed_or_failed = line.startswith("<...") or "= -1 E" in line
        reads = name.startswith("open") and not re.search("O_WRONLY|O_RDWR|O_CREAT", line)
        # numba asks so whether it may write in a folder, which it makes if it is not there
        asks = "O_TMPFILE" in line or (name == "mkdir" and "<unfinished" in line)
        if not (resumed_or_failed or reads or asks):
            written.update(re.findall(r'"((?:[^"\\]|\\.)*)"', line)[-1:])
    return Asked(hosts, written)
