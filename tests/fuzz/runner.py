"""Cases in a process of their own: a crash, a hang or a memory bomb ends that one alone."""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import sys
import time
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from random import Random

from tests.fuzz.readers import READERS, Target

CASE_S = 10.0
"""Longest that a file of `mutate.MOST_BYTES` may take; a valid one takes milliseconds."""

MOST_GROWTH = 1200 * 2**20
"""Bytes that reading may add: the largest image, `MAX_PIXELS` of three channels, 16 bit, twice."""

ADDRESS_SPACE = 6 * 2**30
"""Beyond what is mapped at the start: what asks for more gets a MemoryError."""

STARTUP_S = 60.0


@dataclass(frozen=True, slots=True)
class Failure:
    """A case that was neither read nor refused by us; `kind` is the same for the same fault."""

    reader: str
    seed: int
    kind: str
    details: str


@dataclass(slots=True)
class Tally:
    """How many cases were read, how many refused, and what failed, once of each kind."""

    read: int = 0
    refused: int = 0
    failures: dict[str, Failure] = field(default_factory=dict)

    @property
    def cases(self) -> int:
        return self.read + self.refused


def run_reader(name: str, seeds: Iterator[int], folder: Path) -> Tally:
    """Try a reader with all `seeds`; files of failing cases are kept in ``folder/kept``."""
    tally = Tally()
    child = _Child(name, folder)
    try:
        for seed in seeds:
            answer = child.ask(seed)
            if isinstance(answer, bool):
                tally.read += answer
                tally.refused += not answer
            elif answer.kind not in tally.failures:
                tally.failures[answer.kind] = answer
    finally:
        child.stop()
    return tally


def _keep(name: str, seed: int, folder: Path) -> None:
    spoilt = folder / "in" / READERS[name].file
    kept = folder / "kept" / f"{name}-{seed}{spoilt.suffix}"
    kept.parent.mkdir(parents=True, exist_ok=True)
    if spoilt.is_file():
        kept.write_bytes(spoilt.read_bytes())


class _Child:
    """The process that reads, started again after it died or was killed."""

    def __init__(self, name: str, folder: Path) -> None:
        self._name, self._folder = name, folder
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        arguments = (theirs, self._name, self._folder)
        self._process = context.Process(target=_serve, args=arguments, daemon=True)
        self._process.start()
        theirs.close()
        if not self._pipe.poll(STARTUP_S) or self._pipe.recv() != "ready":
            raise RuntimeError(f"{self._name}: its valid files could not be made or read")

    def ask(self, seed: int) -> bool | Failure:
        self._pipe.send(seed)
        try:
            if self._pipe.poll(CASE_S):
                answer: bool | tuple[str, str] = self._pipe.recv()
                if isinstance(answer, bool):
                    return answer
                _keep(self._name, seed, self._folder)
                return Failure(self._name, seed, *answer)
            kind = "hang"
        except EOFError:
            self._process.join()
            kind = f"crash, exit {self._process.exitcode}"
        trace = self._folder / "in" / "trace.txt"
        details = trace.read_text(errors="replace")[-4000:] if trace.is_file() else ""
        _keep(self._name, seed, self._folder)  # before the valid files are made again
        self.stop()
        self._start()
        return Failure(self._name, seed, kind, details)

    def stop(self) -> None:
        self._process.kill()
        self._process.join()
        self._pipe.close()


def _serve(pipe: Connection, name: str, folder: Path) -> None:
    target, place = READERS[name], folder / "in"
    place.mkdir(parents=True, exist_ok=True)
    trace = (place / "trace.txt").open("w")
    faulthandler.enable(trace)
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())  # the codecs' own complaints
    warnings.simplefilter("error")
    for path in place.glob("l*.png"):  # of the process before
        path.unlink()
    seeds = target.prepare(place)
    _limit_memory()
    pipe.send("ready")
    while True:
        pipe.send(_try(target, seeds, (place, pipe.recv())))


def _try(target: Target, seeds: list[bytes], case: tuple[Path, int]) -> bool | tuple[str, str]:
    folder, seed = case
    start, before = time.perf_counter(), _peak_bytes(reset=True)
    try:
        done = target.spoil_and_read(folder, seeds, Random(seed))
    except Exception as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        kind = f"{type(error).__name__} at {Path(frame.filename).name}:{frame.lineno}"
        return kind, "".join(traceback.format_exception(error))[-4000:]
    growth = _peak_bytes() - before
    if growth > MOST_GROWTH:
        return "memory", f"grew by {growth / 2**20:.0f} MiB"
    if time.perf_counter() - start > CASE_S / 2:
        return "slow", f"took {time.perf_counter() - start:.1f} s"
    return done


def _limit_memory() -> None:
    if sys.platform != "linux":
        return
    import resource

    mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (mapped + ADDRESS_SPACE, mapped + ADDRESS_SPACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _peak_bytes(*, reset: bool = False) -> int:
    """Most memory that this process had since the last reset; 0 where nothing tells."""
    if sys.platform != "linux":
        return 0
    if reset:
        Path("/proc/self/clear_refs").write_text("5")
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM"))
