"""Show that the machines of tests/property can fail: plant bugs, let them find them.

Each bug is a small change of the text of the core, of a kind that people make. The project is
copied, the copy is changed, and the machine runs in the copy until it fails or has passed. A bug
that is not found is a hole in the machine (or is none: a change that nobody can see). The bugs of
the relay are in planted_relay_bugs.py.

    python tools/planted_bugs.py                 all of the store and the intake, two at a time
    python tools/planted_bugs.py --relay         all of the relay
    python tools/planted_bugs.py ttl tombstone   those whose names contain a word
    python tools/planted_bugs.py --markdown      the table of docs/planted-bugs.md

Exits with 1 unless every bug is found, and with 2 if the core has moved on from one of them.
"""

from __future__ import annotations

import concurrent.futures
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import attrs

from planted_relay_bugs import RELAY_BUGS

__all__ = ["BUGS", "RELAY", "STORE", "Bug", "Ground", "Result", "main"]

ROOT = Path(__file__).parents[1]
NEEDED = ["beacon_core", "adapters", "tests/property", "pyproject.toml"]
SEED = "1"


@attrs.frozen
class Bug:
    name: str
    right: str
    """What is written in the core, in one place only."""
    wrong: str


@attrs.frozen
class Ground:
    """Where bugs are planted, and who is to find them."""

    bugs: list[Bug]
    folder: str
    machines: list[str]
    no_bug: Bug


@attrs.frozen
class Result:
    bug: Bug
    found: bool
    steps: int
    seconds: float
    line: str
    """The assertion that failed."""


NO_BUG = Bug("nothing at all, to compare with", "class HintStore:", "class HintStore:")

BUGS = [
    Bug(
        "a message of exactly ttl's age counts as heard in time",
        "Cause.HEARD_LATE if age_ns >= self.ttl_ns else",
        "Cause.HEARD_LATE if age_ns > self.ttl_ns else",
    ),
    Bug(
        "a message of exactly expiry's age is taken",
        "if age_ns >= self.expiry_ns:",
        "if age_ns > self.expiry_ns:",
    ),
    Bug(
        "last_seen goes back on the short way",
        "if record.revision != version or sent_ns < record.last_seen_ns:",
        "if record.revision != version:",
    ),
    Bug(
        "last_seen goes back on the long way",
        "if sent_ns < record.last_seen_ns or (message.sequence",
        "if (message.sequence",
    ),
    Bug(
        "the payload memory ignores the version",
        "if record.revision != version or",
        "if record.revision == 0 or",
    ),
    Bug(
        "the payload memory ignores the incarnation",
        "and run == incarnation",
        "and run is not None",
    ),
    Bug(
        "the payload memory ignores the source",
        "speaker is account",
        "speaker is not None",
    ),
    Bug(
        "the short way ignores whom a message may speak for",
        "and (not entity_id or entity_id == outcome.entity_id)",
        "",
    ),
    Bug(
        "the short way takes a repeated number",
        "if sequence <= record.sequence:",
        "if sequence < record.sequence:",
    ),
    Bug(
        "a tombstone buries nothing",
        "if not is_new_life(message, record):",
        "if record is None:",
    ),
    Bug(
        "a tombstone lasts from the last message, not from the goodbye",
        "end_ns = record.history[-1].at_ns + self.ttl_ns",
        "end_ns = record.last_seen_ns + self.ttl_ns",
    ),
    Bug(
        "the count of conflicts drifts when a contended record ends",
        "self.conflicts -= bool(visible(record.rivals))",
        "self.conflicts -= 0",
    ),
    Bug(
        "an ACTIVE one is displaced",
        "return self.count[Status.ACTIVE] + count <= self.max_hints and (",
        "return self.count[Status.ACTIVE] <= self.max_hints and (",
    ),
    Bug(
        "one heard often gives way before one heard once",
        "1 if record.heard_once else 2",
        "2 if record.heard_once else 1",
    ),
    Bug(
        "the bytes of an ACTIVE one are not counted when it changes",
        "        if record.status is Status.ACTIVE:\n            self._active_bytes += growth",
        "",
    ),
    Bug(
        "a calendar slot is not re-filed after a refresh",
        "nothing to re-file.\n        if sent_ns + self.ttl_ns >= record.slot_end_ns:",
        "nothing to re-file.\n        if False:",
    ),
    Bug(
        "the calendar forgets what is due in the slot at hand",
        "if slot <= self._horizon:",
        "if slot < self._horizon:",
    ),
    Bug(
        "an entry of the heap stays valid when its record is re-filed",
        "return entry[-1].due_ns == entry[0]",
        "return True",
    ),
    Bug(
        "the store does not wake up for a new, nearer deadline",
        "self.next_due_ns = min(self.next_due_ns, deadline_ns)",
        "pass",
    ),
    Bug(
        "a changed hint does not raise the revision",
        "        self.room.resize(record, size)\n        self._changed(record)",
        "        self.room.resize(record, size)\n        record.view = None",
    ),
    Bug(
        "a changed record stays where it was in the order of changes",
        "self.records[entity_id] = self.records.pop(entity_id)",
        "self.records[entity_id] = record",
    ),
    Bug(
        "a reader one removal too far behind is not told so",
        "self.floor = self._log.popleft()[0]",
        "self.floor = self._log.popleft()[0] - 1",
    ),
    Bug(
        "one that came back is told as gone too",
        " if entity_id not in living)",
        ")",
    ),
    Bug(
        "a bucket refills 1 % too fast",
        "self._source_step_ns = math.ceil(_SECOND_NS / source_rate)",
        "self._source_step_ns = math.ceil(_SECOND_NS / source_rate * 0.99)",
    ),
    Bug(
        "strangers may empty the global bucket",
        "or not settled",
        "",
    ),
    Bug(
        "bad input is not charged",
        "if verdict in _BAD_INPUT:",
        "if False:",
    ),
    Bug(
        "a predecessor is never pruned",
        "        if record.rivals:\n            end_ns = min(",
        "        if visible(record.rivals):\n            end_ns = min(",
    ),
    Bug(
        "a restart by inheritance is not counted",
        "if not same_claimant(heir, record):",
        "if not same_claimant(heir, record) and not record.rivals:",
    ),
    Bug(
        "a contender that left keeps its claim",
        "(one for one in record.rivals if one is not rival)",
        "record.rivals",
    ),
    Bug(
        "a rival's words are counted in no cap",
        "return sum(hint_bytes(one.hint) for one in rivals if one.contending)",
        "return 0",
    ),
    Bug(
        "a new life keeps the words of the old one",
        "hint = self.pool.share(heir.hint)",
        "hint = record.hint if record.hint.stable_id else heir.hint",
    ),
    Bug(
        "a message sent before a loss undoes it",
        "if record.cause is Cause.LOST and sent_ns < record.history[-1].at_ns:",
        "if record is None:",
    ),
    Bug(
        "AUTO believes a stamp as old as expiry",
        "age_ns >= expiry_ns",
        "age_ns > expiry_ns",
    ),
    Bug(
        "a source that is folded away takes its counts along",
        "self._past.update(source.all_counts())",
        "source.all_counts()",
    ),
    Bug(
        "another process id of the same source is the same process",
        "if said.process_id != known.process_id:\n            return False",
        "if said.process_id != known.process_id:\n            pass",
    ),
    Bug(
        "the oldest claim stays, the newest gives way",
        "others.sort(key=last_seen)",
        "others.sort(key=last_seen, reverse=True)",
    ),
    Bug(
        "beside one who has gone a predecessor needs no proof",
        " or not is_new_life(message, rival):\n            return Verdict.OLDER",
        ":\n            return Verdict.OLDER",
    ),
    Bug(
        "beside one who has gone a predecessor's word may be older than the last",
        "if message.last_seen_ns < record.last_seen_ns or not is_new_life(message, rival):",
        "if not is_new_life(message, rival):",
    ),
    Bug(
        "who was lost is not remembered beside its heir as long as it should be",
        "if record.cause in _GONE:",
        "if record.cause is Cause.GOODBYE:",
    ),
    Bug(
        "the numbers of former runs are forgotten",
        "elif record.runs and told_before(message, record.runs):",
        "elif record.runs is None:",
    ),
    Bug(
        "the run that has gone last gives way to those before it",
        "return tuple(known.items())[-MAX_FORMER_RUNS:]",
        "return tuple(known.items())[:MAX_FORMER_RUNS]",
    ),
]

STORE = Ground(BUGS, "beacon_core", ["tests/property/test_machine.py"], NO_BUG)
RELAY = Ground(
    [Bug(*one) for one in RELAY_BUGS],
    "beacon_core/relay",
    [f"tests/property/test_relay{name}.py" for name in ("", "_rings", "_many")],
    Bug("nothing at all, to compare with", "class Forwarder(", "class Forwarder("),
)


def main(arguments: list[str]) -> int:
    """Plant the chosen bugs, or all; print what became of each; return the exit code."""
    markdown = "--markdown" in arguments
    ground = RELAY if "--relay" in arguments else STORE
    words = [one for one in arguments if not one.startswith("--")]
    chosen = [bug for bug in ground.bugs if not words or any(word in bug.name for word in words)]
    if markdown:
        print("| planted | found by | after steps |\n| --- | --- | --- |")
    outdated = [bug for bug in chosen if len(places(bug, ROOT / ground.folder)) != 1]
    for bug in outdated:
        print(f"{bug.name}: this is not written in exactly one place any more:\n{bug.right}\n")
    if outdated:
        return 2
    if hunt(ground.no_bug, ground).found:
        raise SystemExit("the machine fails without any planted bug: mend that first")
    results = []
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        for result in pool.map(lambda bug: hunt(bug, ground), chosen):
            print(row(result) if markdown else line(result), flush=True)
            results.append(result)
    missed = sum(not result.found for result in results)
    print(f"\n{len(results) - missed} of {len(results)} planted bugs were found")
    return 1 if missed else 0


def hunt(bug: Bug, ground: Ground) -> Result:
    """Run the machine against a copy of the project with this bug in it."""
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        copy_project(copy)
        plant(bug, copy / ground.folder)
        code, output = run_machine(copy, ground.machines)
    steps = [int(one) for one in re.findall(r"(\d+) steps", output)]
    if code not in (0, 1) or not steps:
        raise SystemExit(f"{bug.name}: the machine did not run\n{output}")
    asserted = re.findall(r"^>\s+(.*)", output, re.MULTILINE)
    return Result(
        bug, code == 1, sum(steps), time.monotonic() - began, asserted[-1] if asserted else ""
    )


def copy_project(target: Path) -> None:
    for name in NEEDED:
        source = ROOT / name
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, target / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, target / name)


def plant(bug: Bug, core: Path) -> None:
    for path in places(bug, core):
        path.write_text(path.read_text().replace(bug.right, bug.wrong))


def places(bug: Bug, core: Path) -> list[Path]:
    """Each file in which it is written, as often as it is."""
    paths = core.glob("*.py")
    return [path for path in paths for _ in range(path.read_text().count(bug.right))]


def run_machine(copy: Path, machines: list[str]) -> tuple[int, str]:
    paths = [copy, *(copy / "adapters").iterdir()]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(map(str, paths)),
        "BEACON_MACHINE_SEED": SEED,
        "BEACON_MACHINE_SHRINK": "0",
        "BEACON_RELAY_STEPS": "100000",
    }
    command = [sys.executable, "-m", "pytest", "-q", "-rP", "-p", "no:cacheprovider"]
    done = subprocess.run(  # noqa: S603
        [*command, "-x", *machines],
        cwd=copy,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


def line(result: Result) -> str:
    mark = "found " if result.found else "MISSED"
    return (
        f"{mark} {result.bug.name:65} {result.steps:6} steps {result.seconds:5.1f} s  {result.line}"
    )


def row(result: Result) -> str:
    found = f"`{result.line}`" if result.found else "**not found**"
    return f"| {result.bug.name} | {found} | {result.steps:,} |"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
