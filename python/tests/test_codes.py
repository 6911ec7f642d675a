"""What stands for the code of a controller in the ids of its runs."""

import importlib
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import maes
from maes._code import code_of

FIRST = '''
import functools
import math
import enum
import numpy as np
import maes
import helpers

SPEED = 2.0
NEAR = (1, frozenset({"a", "b", "c"}))
WEIGHTS = np.arange(3.0)
TURN = maes.Motion.turn(1.0)

class Kind(enum.Enum):
    LEFT = 1

def score(cell, factor=3.0):
    """How good it is."""
    return inner(cell) * factor + math.pi + maes.CellState.FREE

def inner(cell):
    return max(one * SPEED for one in cell if one not in {1, 2, 3})

def twice(function):
    @functools.wraps(function)
    def around(*values):
        return 2 * function(*values)
    return around

class Tool:
    size = 4
    def __init__(self, size=size):
        self.size = size

class Base(maes.Controller):
    """goes on"""
    reach_m = 5.0
    log = []
    count = 0
    settings = {"turn_rad": (2.0, 0.0, 3.14)}

    @property
    def far(self):
        return self.reach_m > 3.0

class Mine(Base):
    """goes on and on"""
    name = "Mine"

    def __init__(self, rng, values):
        super().__init__(rng, values)
        self.tool = Tool()

    def decide(self, observation, ctx):
        # A comment.
        Mine.count += 1
        self.log.append(Kind.LEFT)
        if score(ctx.cells) > helpers.limit(NEAR) + self.weight() + WEIGHTS[0]:
            return maes.Command(TURN, maes.WakeCondition.TASK_DONE)
        return maes.Command.keep(maes.WakeCondition.TASK_DONE)

    @staticmethod
    @twice
    def weight():
        return [one for one in (lambda: (5, 6))()]
'''
HELPERS = "FAR = 7\ndef limit(near):\n    return FAR * len(near)\ndef other():\n    return 1\n"


def made(text=FIRST, helpers=HELPERS, monkeypatch=None):
    """The class `Mine` of a module with this text."""
    modules = {name: ModuleType(name) for name in ("helpers", "mine")}
    with pytest.MonkeyPatch.context() as patch:
        for name, module in modules.items():
            patch.setitem(sys.modules, name, module)
        exec(compile(helpers, "helpers.py", "exec"), vars(modules["helpers"]))
        exec(compile(text, "mine.py", "exec"), vars(modules["mine"]))
        yield modules["mine"].Mine


def code(text=FIRST, helpers=HELPERS, **keys):
    return next(code_of(found, **keys) for found in made(text, helpers))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("# A comment.", "# Another comment.\n\n        # And one more."),
        ('"""goes on and on"""', '"""stands still"""'),
        ('    """How good it is."""\n', ""),
        ("\nclass Base", "\n\n\n\nUNUSED = 3\n\nclass Base"),
        ("class Base", "def unused():\n    return 1\n\nclass Base"),
        ("return 1", "return 2"),
    ],
)
def test_what_is_no_code_of_the_class(old, new):
    assert old in FIRST + HELPERS
    assert code(FIRST.replace(old, new), HELPERS.replace(old, new)) == code()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("Motion.turn(1.0)", "Motion.turn(1.5)"),
        ("command(TURN", "command(maes.Motion.stop()"),
        ("SPEED = 2.0", "SPEED = 3.0"),
        ("factor=3.0", "factor=3.5"),
        ('"c"}', '"d"}'),
        ("{1, 2, 3}", "{1, 2, 4}"),
        ("arange(3.0)", "arange(1.0, 4.0)"),
        ("LEFT = 1", "LEFT = 2"),
        ("inner(cell) *", "inner(cell) +"),
        ("math.pi", "math.e"),
        ("CellState.FREE", "CellState.WALL"),
        ("2 * function", "3 * function"),
        ("    size = 4", "    size = 5"),
        ("reach_m = 5.0", "reach_m = 4.0"),
        ("> 3.0", "> 3.5"),
        ("count = 0", "count = 1"),
        ("log = []", "log = [1]"),
        ('(2.0, 0.0, 3.14)', '(1.0, 0.0, 3.14)'),
        ("(5, 6)", "(5, 7)"),
        ("def weight():", "def weight(*values):"),
        ("self.tool = Tool()", "self.tool = Tool(9)"),
        ("FAR = 7", "FAR = 8"),
        ("FAR * len", "FAR + len"),
        ("class Mine(Base):", "class Mine(Base):\n    version = 2"),
    ],
)
def test_what_changes_the_code_of_the_class(old, new):
    old, new = old.replace("command(", "Command("), new.replace("command(", "Command(")
    assert old in FIRST + HELPERS
    assert code(FIRST.replace(old, new), HELPERS.replace(old, new)) != code()


def test_what_code_changes_while_it_runs_is_no_other_code():
    for found in made():
        before = code_of(found), code_of(found, is_copy_equal=True)
        found.log.append("a note")
        found.count += 1
        vars(sys.modules["mine"])["WEIGHTS"][0] = 9.0
        assert (code_of(found), code_of(found, is_copy_equal=True)) == before
        found.reach_m = 1.0
        assert code_of(found) != before[0] and code_of(found, is_copy_equal=True) != before[1]
    # Classes of equal text, of which one was used.
    assert code(is_copy_equal=True) == next(code_of(one, is_copy_equal=True) for one in made())


def test_closures_and_functions_of_a_notebook():
    def of(turn_rad, steps):
        def turned():
            return turn_rad * len(steps)

        class Turns(maes.Controller):
            def decide(self, observation, ctx):
                return maes.Command(maes.Motion.turn(turned()), maes.WakeCondition.TASK_DONE)

        return Turns

    assert code_of(of(1.0, [1])) == code_of(of(1.0, [1])) != code_of(of(2.0, [1]))
    assert code_of(of(1.0, [1])) != code_of(of(1.0, [2]))


def test_equal_in_every_process(tmp_path):
    (tmp_path / "mine.py").write_text(FIRST)
    (tmp_path / "helpers.py").write_text(HELPERS)
    call = "import maes._code, mine; print(maes._code.code_of(mine.Mine))"
    package = str(Path(maes.__file__).parents[1])
    found = set()
    for seed in ("1", "2", "3"):
        variables = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join([str(tmp_path), package])}
        done = subprocess.run([sys.executable, "-c", call], env=variables, capture_output=True, text=True, check=True)
        found.add(done.stdout.strip())
    assert len(found) == 1 and len(found.pop()) == 32


def test_imports_within_functions_count(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)

    class Imports(maes.Controller):
        def decide(self, observation, ctx):
            import imported_by_decide
            import numpy.linalg

            return imported_by_decide.command(numpy.linalg.norm([1.0]))

    def of(text):
        (tmp_path / "imported_by_decide.py").write_text(text)
        importlib.invalidate_caches()
        return code_of(Imports)

    assert code_of(Imports) == code_of(Imports) != of("ONE = 1") != of("ONE = 2")
    assert of("ONE = 1") == of("ONE = 1") and "imported_by_decide" not in sys.modules


def test_what_holds_itself_ends():
    class Knot(maes.Controller):
        others = []
        weights = {"a": np.zeros(3)}

    Knot.others.append(Knot)
    Knot.all = frozenset({Knot, "b"})
    Knot.others.append(Knot.others)
    assert code_of(Knot) == code_of(Knot)
