# SPDX-License-Identifier: BSD-3-Clause
"""Child processes with limits on time and memory."""
from __future__ import annotations

import os
import resource
import signal
import time
from dataclasses import dataclass
from pathlib import Path

SHARE_OF_MEMORY = 0.8
GRACE = 5.0  # from the interrupt to the kill [s]
POLL = 0.02  # [s]; seldom, so as not to disturb the child


@dataclass
class Outcome:
    """How a program ended."""

    in_time: bool  # False: it was stopped because its time was over
    exit_code: int  # negative: killed by that signal
    seconds: float  # of the whole process
    peak_memory: float  # resident [bytes]
    output: str
    complaint: str  # the last line of standard error
    processor: float = 0.0  # time of all threads, in user mode and in the system [s]


def allowed_memory() -> float:
    """Bytes that a program is allowed: one that wants more is to fail, not to take the machine down."""
    return SHARE_OF_MEMORY * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def _wait(child: int, seconds: float | None) -> tuple[int, resource.struct_rusage] | None:
    """Status and usage of a child that ended within that many seconds; None: it still runs."""
    if seconds is None:
        return os.wait4(child, 0)[1:]
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        pid, status, usage = os.wait4(child, os.WNOHANG)
        if pid == child:
            return status, usage
        time.sleep(POLL)
    return None


def run_program(words: list[str], work: Path, limit: float = 0.0) -> Outcome:
    """Runs a program, with its standard output and error in files of the folder `work`.

    After `limit` seconds (0: none) it is interrupted, as by Ctrl-C, upon which cairn reports how far it came; a little
    later it is killed. Raises OSError if it cannot be started.
    """
    work.mkdir(parents=True, exist_ok=True)
    # Another measurement may use the same folder at the same time.
    out, error = work / f"child.{os.getpid()}.out", work / f"child.{os.getpid()}.err"
    write = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
    begin = time.monotonic()
    files = [(os.POSIX_SPAWN_OPEN, 0, "/dev/null", os.O_RDONLY, 0),
             (os.POSIX_SPAWN_OPEN, 1, os.fspath(out), write, 0o644), (os.POSIX_SPAWN_OPEN, 2, os.fspath(error), write, 0o644)]
    # Python ignores SIGPIPE, and a shell may have ignored SIGINT.
    child = os.posix_spawnp(words[0], words, os.environ, file_actions=files, setsigdef=[signal.SIGINT, signal.SIGPIPE])
    most = int(allowed_memory())
    resource.prlimit(child, resource.RLIMIT_AS, (most, most))
    ended = _wait(child, limit if limit > 0.0 else None)
    in_time = ended is not None
    if ended is None:
        os.kill(child, signal.SIGINT)
        ended = _wait(child, GRACE)
    if ended is None:
        os.kill(child, signal.SIGKILL)
        ended = _wait(child, None)
    assert ended is not None
    status, usage = ended
    seconds = time.monotonic() - begin
    said, complaints = (file.read_text(encoding="utf-8", errors="replace") for file in (out, error))
    for file in (out, error):
        file.unlink()
    return Outcome(in_time=in_time, exit_code=os.waitstatus_to_exitcode(status), seconds=seconds,
                   peak_memory=1024.0 * usage.ru_maxrss, output=said, complaint=complaints.rstrip("\n").split("\n")[-1],
                   processor=usage.ru_utime + usage.ru_stime)
