"""What tests of several parts share: the command line in this process, and a small campaign on disk."""

from __future__ import annotations

import gc
import os
import sys

# Before NumPy is imported: two workers with two threads of linear algebra each, on two cores, wait for one another.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
# Workers, and processes begun here, load what one of them has translated, as they do anywhere else; numba keeps its
# code there, too.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

import re
import signal
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from tests.doors.asked import Answer, without_stages

# The same examples every time, however long each takes and whatever an earlier run has kept.
settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")


TESTS = Path(__file__).resolve().parent
# Data that ship with the package, and that a person reads.
LIBRARIES, RIGS = TESTS.parent / "libraries", TESTS.parent / "sindyjoint" / "mechanics" / "rig_files"


def pytest_collection_finish():
    """Look for cycles seldom: each full search goes through all that the tests' modules hold."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 50)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Send tests that share a fixture of a file or folder to one worker, so that it is made once.

    Units of many tests come first: none is left for one worker when the others have nothing more to do. (Groups as
    ``--dist loadgroup`` has them are lost between pytest 9.2 and xdist 3.8.)
    """
    from xdist.scheduler import LoadScopeScheduling

    class BySharedFixture(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            return unit_of(nodeid)

    return BySharedFixture(config, log)


def unit_of(nodeid: str) -> str:
    """Return what a test runs with on one worker: its folder, its file, or the other cases of its function."""
    file, _, _ = nodeid.partition("::")
    return shared_home(file) or nodeid.partition("[")[0]


@cache
def shared_home(file: str) -> str:
    """Return the folder or file whose tests share a fixture, or nothing where they do not."""
    path = TESTS.parent / file
    beside = path.parent / "conftest.py"
    if path.parent != TESTS and beside.is_file() and 'scope="session"' in beside.read_text(encoding="utf-8"):
        return path.parent.relative_to(TESTS.parent).as_posix()
    return file if re.search(r'scope="(module|session)"', path.read_text(encoding="utf-8")) else ""


@pytest.fixture
def sindyjoint(capsys) -> Callable[..., Answer]:
    """Run the command line as a person would, in this process; a traceback would fail the test."""
    from sindyjoint.cli import main

    def run(*arguments: object) -> Answer:
        capsys.readouterr()
        with pytest.raises(SystemExit) as leave:
            main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        messages = without_stages(captured.err, arguments)
        return Answer(int(leave.value.code or 0), captured.out, messages)

    return run


MANIFEST = """
[joint]
name = "bench joint"
inertia = "0.02 kg*m^2"

[channels]
time = { column = "t", unit = "s" }
moment = { column = "m", unit = "N*m" }
angle = { column = "a", unit = "mrad" }

[[run]]
file = "run.csv"
frequency = 4.0
"""


class Folder:
    """A campaign of one run on disk, that a test bends in one place."""

    def __init__(self, path: Path):
        self.path = path
        t = np.arange(800) / 400.0
        rate = np.cos(8 * np.pi * t)
        noise = np.random.default_rng(0).normal(scale=0.01, size=(2, t.size))
        angle = 0.7 * np.sin(8 * np.pi * t)
        self.columns = {
            "t": t,
            "m": 5 * angle + 0.5 * rate + 1.5 * np.sign(rate) + noise[0],
            "a": angle + 0.1 * noise[1],
        }
        self.manifest(MANIFEST)
        self.table(self.columns)

    def manifest(self, text: str) -> None:
        (self.path / "campaign.toml").write_text(text, encoding="utf-8")

    def replace(self, old: str, new: str) -> None:
        text = (self.path / "campaign.toml").read_text(encoding="utf-8")
        assert old in text
        self.manifest(text.replace(old, new))

    def table(self, columns: dict[str, np.ndarray]) -> None:
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        text = "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]) + "\n"
        (self.path / "run.csv").write_text(text, encoding="utf-8")

    def line(self, number: int, text: str) -> None:
        """Replace one line of run.csv, counted from 1."""
        lines = (self.path / "run.csv").read_text(encoding="utf-8").split("\n")
        lines[number - 1] = text
        (self.path / "run.csv").write_text("\n".join(lines), encoding="utf-8")


#: Parts and files whose pictures are looked at, or are of a kind that is drawn nowhere else.
PICTURES = {
    "browser", "test_curves.py", "test_discover_rig.py", "test_doors_verbs.py", "test_examples.py", "test_reproduce.py",
    "test_reporting_figures.py", "test_reporting_output.py", "test_reporting_page.py", "test_rig_motion.py",
}  # fmt: skip
_drawn_in_full = True


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    """Say whether a test and its fixtures need whole pictures: those of some parts do, and who asks for `pictures`."""
    global _drawn_in_full
    _drawn_in_full = bool(PICTURES & {*item.path.relative_to(TESTS).parts}) or "pictures" in item.fixturenames


@pytest.fixture
def pictures():
    """Ask for whole pictures."""


@pytest.fixture(scope="session", autouse=True)
def pictures_that_nobody_looks_at_are_sketched():
    """Fill the panels of every picture, but neither lay out nor write them, which takes most of a report's time."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    def laid_out(engine, figure):
        if _drawn_in_full:
            lay_out(engine, figure)

    def written(canvas, *args, **options):
        if not _drawn_in_full:
            canvas = FigureCanvasSVG(Figure(canvas.figure.get_size_inches()))
        return write(canvas, *args, **options)

    lay_out, write = ConstrainedLayoutEngine.execute, FigureCanvasSVG.print_svg
    ConstrainedLayoutEngine.execute, FigureCanvasSVG.print_svg = laid_out, written
    yield
    ConstrainedLayoutEngine.execute, FigureCanvasSVG.print_svg = lay_out, write


@pytest.fixture(scope="session", autouse=True)
def no_step_makes_the_gap_larger():
    """Check every diagnosis that a test of this process makes: the gap falls from step to step, or group of steps."""
    from sindyjoint.diagnosis import grows, reported_together
    from sindyjoint.diagnosis.result import Diagnosis

    plain = Diagnosis.__init__

    def checked(self, *args, **kwargs):
        plain(self, *args, **kwargs)
        before = self.initial
        for group in reported_together(self.steps):
            names = [step.effect for step in group]
            # By their text: what is not known is NaN.
            assert {str(step.gap_before) for step in group} == {str(before)}, names
            assert len({str(step.gap_after) for step in group}) == 1, names
            assert not grows(before, group[0].gap_after), names
            before = group[0].gap_after

    Diagnosis.__init__ = checked
    yield
    Diagnosis.__init__ = plain


def effects_named(*names: str) -> tuple:
    """Return some of the shipped effects, as `diagnose` takes them."""
    from sindyjoint.diagnosis import load_effects, select_effects

    return tuple(select_effects(load_effects(), names))


@pytest.fixture
def few_effects(monkeypatch) -> Callable[..., tuple]:
    """Let diagnoses know but some effects of the joint and its test, where not the search for them is tested."""

    def only(*names: str) -> tuple:
        few = effects_named(*names)
        monkeypatch.setattr("sindyjoint.workflows.diagnose.load_effects", lambda library=(): few)
        return few

    return only


@pytest.fixture
def heard():
    """Hear Ctrl-C, here and in processes begun here, also where tests run in the background, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    made = tmp_path / "campaign"
    made.mkdir()
    return Folder(made)


@pytest.fixture
def model_file(tmp_path: Path) -> Path:
    """Return the file of the paper's model."""
    from tests.made_models import paper_model

    path = tmp_path / "model.json"
    path.write_text(paper_model().to_json())
    return path


@pytest.fixture
def bound_by_permissions() -> Iterator[tuple[Path, Callable[[], AbstractContextManager]]]:
    """Return a new folder, and what makes permission bits bind this process for a while: the superuser is nobody."""
    superuser = hasattr(os, "geteuid") and os.geteuid() == 0

    @contextmanager
    def bound() -> Iterator[None]:
        if superuser:
            os.seteuid(NOBODY)
        try:
            yield
        finally:
            if superuser:
                os.seteuid(0)

    # A folder of pytest's own may be entered by its owner only.
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        if superuser:
            os.chown(folder, NOBODY, -1)
        yield folder, bound


NOBODY = 65534
SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture
def public_data() -> Callable[[str], Path]:
    """Return the folder of a public data set, or skip where it is absent."""

    def find(name: str) -> Path:
        if not (SHARED / name / "campaign.toml").is_file():
            pytest.skip(f"public data {name!r} is not beside the checkout")
        return SHARED / name

    return find
