"""``python -m tests.fuzz --minutes 10 --reader png``: spoilt files for one reader, or for all."""

from __future__ import annotations

import argparse
import itertools
import shutil
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from random import Random

from tests.fuzz.kills import COMMANDS, OLD, check_files, prepare
from tests.fuzz.readers import READERS
from tests.fuzz.runner import Tally, run_reader


def main() -> int:
    """Exit status: 1 where anything failed."""
    options = _options()
    if options.kills:
        return try_kills(options.kills, options.seed, options.keep / "kills")
    names = options.reader or list(READERS)
    failed = 0
    for name in names:
        needed = READERS[name].needs
        if needed is not None and find_spec(needed) is None:
            print(f"{name}: skipped, {needed} is not installed")
            continue
        start = options.seed if options.case is None else options.case
        seeds = _seeds(start, options.minutes * 60, 1 if options.case is not None else None)
        tally = run_reader(name, seeds, options.keep / name)
        _tell(name, start, tally)
        failed += len(tally.failures)
    return 1 if failed else 0


def try_kills(times: int, seed: int, folder: Path) -> int:
    """Kill every command at random moments of its run; what is left half done is raised."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    folder = folder.resolve()
    prepare(folder, boards=True)
    for name, command in COMMANDS.items():
        random, target, done = Random(f"{seed} {name}"), folder / command.writes, 0
        start = time.monotonic()
        assert command.run(folder) == 0, (folder / "log.txt").read_text()
        whole = time.monotonic() - start
        for _ in range(times):
            if target.suffix:
                target.write_bytes(OLD)
            done += command.run(folder, seconds=random.uniform(0, whole)) == -9
            check_files(target)
        assert command.run(folder) == 0, (folder / "log.txt").read_text()
        check_files(target)
        print(f"{name}: {done} of {times} runs killed, files old or whole, runs again", flush=True)
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0, help="for each reader")
    parser.add_argument("--reader", action="append", choices=list(READERS), help="default: all")
    parser.add_argument(
        "--seed", type=int, default=0, help="of the first case; the next has one more"
    )
    parser.add_argument("--case", type=int, help="this case alone")
    parser.add_argument("--kills", type=int, help="kill every command so many times, no reader")
    parser.add_argument(
        "--keep", type=Path, default=Path("out/fuzz"), help="folder of failing files"
    )
    return parser.parse_args()


def _seeds(start: int, seconds: float, most: int | None) -> Iterator[int]:
    end = time.monotonic() + seconds
    for seed in itertools.islice(itertools.count(start), most):
        if time.monotonic() > end:
            return
        yield seed


def _tell(name: str, start: int, tally: Tally) -> None:
    print(
        f"{name}: {tally.cases} cases from seed {start}: {tally.read} read, "
        f"{tally.refused} refused, {len(tally.failures)} kinds of failure",
        flush=True,
    )
    for failure in tally.failures.values():
        print(f"  case {failure.seed}: {failure.kind}\n{failure.details}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
