"""The house and its plan: which package may import which, read from the source."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FLOORS = (
    ("cli",),
    ("experiments",),
    ("config", "reports"),
    ("training", "gym"),
    ("simulation",),
    ("tasks",),
    ("learning", "store", "logic"),
    ("errors", "registry", "resources", "settings", ""),  # the ground: modules of tltlrl itself, "" is its __init__
)
FLOOR_OF = {room: len(FLOORS) - i for i, rooms in enumerate(FLOORS) for room in rooms}
GROUND = 1  # its modules may import each other
MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for path in sorted((ROOT / "tltlrl").rglob("*.py"))
}
PACKAGES = sorted(name for name, path in MODULES.items() if path.name == "__init__.py")


def room(module):
    """The part of the house that a module stands in."""
    return module.split(".")[1] if "." in module else ""


def imports(name):
    """Modules of tltlrl that a module imports, at its head or in a function; not those for type checking alone."""
    found = set()

    def visit(node):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            return
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names if alias.name in MODULES)
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module in MODULES:
            parts = {f"{node.module}.{alias.name}" for alias in node.names}
            inside = parts & MODULES.keys()
            found.update(inside)
            if parts - inside:
                found.add(node.module)
        for child in ast.iter_child_nodes(node):
            visit(child)

    visit(ast.parse(MODULES[name].read_text(encoding="utf-8")))
    return found - {name}


def test_every_part_of_the_house_has_its_floor():
    assert {room(name) for name in MODULES} <= FLOOR_OF.keys()


@pytest.mark.parametrize("name", MODULES)
def test_arrows_run_downwards_only(name):
    """Late imports count, too, but for the names that tltlrl's own __init__ gives by importlib."""
    own = FLOOR_OF[room(name)]
    wrong = {
        other for other in imports(name) if room(other) != room(name) and FLOOR_OF[room(other)] >= max(own, GROUND + 1)
    }
    assert not wrong, f"{name} imports {', '.join(sorted(wrong))}"


def test_no_relative_imports():
    """The other tests here read absolute names."""
    for name, path in MODULES.items():
        nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        assert not any(isinstance(node, ast.ImportFrom) and node.level for node in nodes), name


def test_the_monitor_knows_no_spec():
    """What of `logic` stands above `logic.online` is not seen from there."""
    inside = {name for name in MODULES if name.startswith("tltlrl.logic.online.")}
    above = {name for name in MODULES if name.startswith("tltlrl.logic.") and imports(name) & inside} - inside
    assert "tltlrl.logic.spec" in above
    assert not above & set().union(*map(imports, inside))


def test_no_circles_among_modules():
    rest = {name: imports(name) for name in MODULES}
    while free := [name for name, others in rest.items() if not others & rest.keys()]:
        for name in free:
            del rest[name]
    assert not rest, f"circles, or modules that lead into one: {rest}"


@pytest.mark.parametrize("name", ["tltlrl.logic", "tltlrl.learning", "tltlrl.learning.reps"])
def test_logic_and_learning_work_alone(name):
    rooms = {"tltlrl.tasks", "tltlrl.simulation", "tltlrl.training", "tltlrl.config"}
    heavy = {"mujoco", "dm_control", "hydra", "pandas", "matplotlib", *rooms}
    code = (
        "import importlib, pkgutil, sys\n"
        f"package = importlib.import_module({name!r})\n"
        "for module in pkgutil.walk_packages(package.__path__, package.__name__ + '.'):\n"
        "    importlib.import_module(module.name)\n"
        f"print(sorted({heavy!r} & sys.modules.keys()))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("[]\n", "")


@pytest.mark.parametrize("name", PACKAGES)
def test_every_package_says_shortly_what_belongs_there(name):
    docstring = ast.get_docstring(ast.parse(MODULES[name].read_text(encoding="utf-8")))
    assert docstring
    assert len(docstring.splitlines()) <= 8
