"""What holds for the whole source tree: who may import whom, and what must not stand in any file."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "flexviz"
SOURCES = sorted(PACKAGE.rglob("*.py"))
LONGEST_FILE = 350  # [lines] of the product; other files may have 420
LONGEST_FUNCTION = 60  # [lines]

# Data flow one way: a package may import from its own row and from rows above it. The rooms stand in their
# order. Of a room in several rows, what stands lower is needed by other rooms; what stands higher needs them.
LAYERS = (
    {
        "base": "_scipy arrays errors facts fields files fourier hooks iteration jobs limits names"
        " nonnegative pages parallel progress recent resources schemas search spelling statistics toml units"
    },
    {"robot": "_pinocchio model mounting robot robot_files urdf_checks urdf_inertias urdf_joints urdf_units"},
    {"model": "effects"},  # a set names those of its model
    # results are made as records, some with sentences and curves
    {"content": "blocks charts records rendering wording"},
    {"data": "logs measurements noise"},
    {"checks": ""},
    {"model": "compensation equation observers servo simulation", "content": "results"},
    {"analysis": "acceptance designing diagnosis estimation identification laws motion servo"},
    {"data": "importing", "content": "comparing scene session topics view"},  # an import identifies a delay
    {"outlets": "app batch doctor exporting recording report terminal workflows"},
)
RANK = {
    f"{room}/{name}".rstrip("/"): rank
    for rank, row in enumerate(LAYERS)
    for room, names in row.items()
    for name in names.split() or [""]
}
ROOMS = {room for row in LAYERS for room in row}


def unit(path: Path) -> str:
    """The package or module of a room that a file belongs to, as "robot/mounting"; "" where there is none."""
    return unit_of(module_name(path))


def unit_of(name: str) -> str:
    """The same for a module's dotted name."""
    _, room, inside, *_ = (*name.split("."), "", "")
    return room if room in RANK else f"{room}/{inside}" if inside else ""


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def imports(path: Path) -> Iterator[tuple[str, int]]:
    """Every absolute module name a file imports, wherever in it, with its line."""
    package = ("flexviz", *path.relative_to(PACKAGE).parts[:-1])
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node.lineno
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            module = ".".join(part for part in (base, node.module or "") if part)
            yield module, node.lineno
            for alias in node.names:
                yield f"{module}.{alias.name}", node.lineno


def tracked() -> list[Path]:
    try:
        names = subprocess.run(
            ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True
        ).stdout.split("\0")
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout")
    return [ROOT / name for name in names if name and (ROOT / name).is_file()]


@pytest.mark.parametrize("module, home", [("viser", "outlets/app"), ("rerun", "outlets/recording")])
def test_only_one_place_imports(module: str, home: str) -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line} imports {name}"
        for path in SOURCES
        if unit(path) != home
        for name, line in imports(path)
        if name.split(".")[0] == module
    ]
    assert not found, f"only flexviz/{home} may import {module}"


# attributes and elements of viser's page that it documents nowhere
VISERS_PAGE = re.compile(
    r"mantine-|data-mantine|data-dock|data-floating|__viser|__r3f|file_upload_|uplot-container"
)


def test_viser_inside_is_known_to_one_place() -> None:
    from flexviz.outlets.app.viser_private import TRIED_WITH

    found, private = list[str](), ("viser_private", "viser_frames")
    for path in (
        file for file in sorted((PACKAGE / "outlets" / "app").rglob("*.*")) if file.suffix in (".py", ".js")
    ):
        if path.stem in private:
            continue
        found += [f"{path.name}: {text}" for text in VISERS_PAGE.findall(path.read_text(encoding="utf-8"))]
        if path.suffix == ".py":
            found += [
                f"{path.name}: imports {name}" for name, _ in imports(path) if re.match(r"viser.*\._", name)
            ]
            found += [
                f"{path.name}:{node.lineno}: {ast.unparse(node)}"
                for node in ast.walk(tree(path))
                if isinstance(node, ast.Attribute) and re.match("_(?!_)", node.attr)
                if ast.unparse(node.value) not in ("self", "cls")
            ]
    assert not found, f"what leans on viser's inside belongs into flexviz/app/{private[0]}.py or .js"
    pinned = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert f'"viser=={TRIED_WITH}"' in pinned and metadata.version("viser") == TRIED_WITH


def test_every_module_has_its_layer() -> None:
    unknown = {unit(path) for path in SOURCES} - RANK.keys() - {""}
    assert not unknown, "put it where it belongs in LAYERS"


def test_data_flow_one_way() -> None:
    wrong = []
    for path in SOURCES:
        here = unit(path)
        if not here:
            continue
        for name, line in imports(path):
            if name.startswith("flexviz.") and RANK.get(unit_of(name), -1) > RANK[here]:
                wrong.append(f"{path.relative_to(ROOT)}:{line} imports {name}")
    assert not wrong


def test_simulator_is_independent_of_the_identification() -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line} imports {name}"
        for path in SOURCES
        if unit(path) == "model/simulation"
        for name, line in imports(path)
        if name.startswith(
            ("flexviz.model.equation", "flexviz.analysis.estimation", "flexviz.analysis.identification")
        )
    ]
    assert not wrong, "a simulator built on the identification's equation would only confirm it"


def test_nothing_runs_text_or_unpickles() -> None:
    wrong = []
    for path in SOURCES:
        for name, line in imports(path):
            if name.split(".")[0] in {
                "pickle",
                "cPickle",
                "dill",
                "cloudpickle",
                "shelve",
                "marshal",
                "joblib",
            }:
                wrong.append(f"{path.relative_to(ROOT)}:{line} imports {name}")
        for node in ast.walk(tree(path)):
            if not isinstance(node, ast.Call):
                continue
            if isinstance(node.func, ast.Name) and node.func.id in {"eval", "exec", "compile", "__import__"}:
                wrong.append(f"{path.relative_to(ROOT)}:{node.lineno} calls {node.func.id}")
            for keyword in node.keywords:
                on = isinstance(keyword.value, ast.Constant) and keyword.value.value is True
                if keyword.arg in {"allow_pickle", "shell"} and on:
                    wrong.append(f"{path.relative_to(ROOT)}:{node.lineno} passes {keyword.arg}=True")
    assert not wrong


def test_no_address_of_a_package_registry_and_no_local_path() -> None:
    # written in parts, so that this file does not contain them
    hosts = [
        ".".join(parts)
        for parts in (
            ("pypi", "org"),
            ("pythonhosted", "org"),
            ("anaconda", "org"),
            ("npmjs", "org"),
            ("npmjs", "com"),
            ("debian", "org/debian"),
        )
    ]
    places = [
        "/" + "/".join(parts)
        for parts in (("opt", "pypi"), ("work", "main"), ("work", "shared"), ("tmp", "w/"))
    ]
    forbidden = [text.encode() for text in hosts + places]
    wrong = [
        f"{path.relative_to(ROOT)} contains {text.decode()}"
        for path in tracked()
        for text in forbidden
        if text in path.read_bytes()
    ]
    assert not wrong


def test_no_unsaved_work_is_part_of_the_project() -> None:
    """The app keeps it beside the bundled sets while they are open."""
    assert not [path for path in tracked() if ".unsaved" in path.parts]


def test_lock_file_has_hashes_and_no_addresses() -> None:
    text = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    assert "://" not in text and "--find-links" not in text
    requirements = [block for block in text.replace("\\\n", " ").splitlines() if block and block[0].isalnum()]
    assert len(requirements) > 50
    assert all("==" in block and "--hash=sha256:" in block for block in requirements)


def test_lock_file_pins_the_extras_that_packages_ask_for() -> None:
    """Where only `name` is pinned, pip takes the newest `name[extra]`, and refuses it for want of a hash."""
    text = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    lines = [line.rstrip("\\ ") for line in text.splitlines() if line and line[0].isalnum()]
    locked = {canonicalize_name(requirement.name): requirement for requirement in map(Requirement, lines)}
    asked = []
    for name, pin in locked.items():
        with suppress(metadata.PackageNotFoundError):  # of another platform
            wanted = map(Requirement, metadata.requires(name) or ())
            asked += [r for r in wanted if r.extras and applies(r, pin.extras)]
    assert len(asked) > 1
    assert not [str(r) for r in asked if not r.extras <= locked[canonicalize_name(r.name)].extras]


def applies(requirement: Requirement, extras: set[str]) -> bool:
    """Whether a package that is installed with these extras needs it here."""
    marker = requirement.marker
    return marker is None or any(marker.evaluate({"extra": extra}) for extra in ("", *extras))


def test_files_and_functions_are_short() -> None:
    long = []
    for folder, most in (("flexviz", LONGEST_FILE), ("tests", 420), ("benchmarks", 420)):
        for path in (ROOT / folder).rglob("*.py"):
            lines = len(path.read_text(encoding="utf-8").splitlines())
            if lines > most:
                long.append(f"{path.relative_to(ROOT)}: {lines} lines")
    for path in SOURCES:
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                lines = (node.end_lineno or node.lineno) - node.lineno + 1
                if lines > LONGEST_FUNCTION:
                    long.append(f"{path.relative_to(ROOT)}:{node.lineno}: {node.name} has {lines} lines")
    assert not long


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in SOURCES}


def face_of(package: str) -> set[str]:
    """The names that a package's `__init__.py` defines or imports."""
    names: set[str] = set()
    for node in tree(MODULES[package]).body:
        if isinstance(node, ast.ImportFrom):
            names |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
    return names


def test_a_package_is_imported_by_its_public_face() -> None:
    wrong = []
    for path in SOURCES:
        for name, line in imports(path):
            package = f"flexviz.{unit_of(name).replace('/', '.')}"
            if name not in MODULES or name == package or unit_of(name) in ("", unit(path)):
                continue
            inside = name.removeprefix(f"{package}.").split(".")[0]
            if inside not in face_of(package):  # a face may offer a function of its module's name
                wrong.append(f"{path.relative_to(ROOT)}:{line} imports {name}, not {package}'s face")
    assert not wrong


def test_a_room_is_a_folder_of_packages() -> None:
    """It offers nothing of its own; other modules at the top re-export a package that users import."""
    assert {path.name for path in PACKAGE.iterdir() if path.is_dir() and is_room(path)} <= ROOMS
    for room in ROOMS & {path.name for path in PACKAGE.iterdir()}:
        if room not in RANK:
            assert not face_of(f"flexviz.{room}"), room
    doors = {name for name in MODULES if name.count(".") == 1 and not is_face(name)} - {"flexviz.__main__"}
    for door in doors:
        _, line = tree(MODULES[door]).body
        assert isinstance(line, ast.ImportFrom) and [alias.name for alias in line.names] == ["*"], door
    assert not [path for path in SOURCES if doors & {name for name, _ in imports(path)}]


def is_room(path: Path) -> bool:
    return any(path.rglob("*.py"))


def test_no_import_circle() -> None:
    """Neither between packages nor between the modules of one; a package's own face only re-exports."""
    arrows: dict[str, set[str]] = {}
    for name, path in MODULES.items():
        found = {n for n, _ in imports(path) if n in MODULES and n != name}
        own_face = name.rpartition(".")[0]
        arrows[name] = {n for n in found if not (n == own_face or (name.startswith(f"{n}.") and is_face(n)))}
    sorter = TopologicalSorter(arrows)
    try:
        sorter.prepare()
    except CycleError as error:
        raise AssertionError(f"import circle: {' -> '.join(reversed(error.args[1]))}") from None


def is_face(name: str) -> bool:
    return MODULES[name].name == "__init__.py"


def test_public_class_names_are_unique() -> None:
    homes: dict[str, list[str]] = {}
    for path in SOURCES:
        for node in tree(path).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    assert not {name: files for name, files in homes.items() if len(files) > 1}


def test_the_normal_quantile_stands_once() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in SOURCES
        for node in ast.walk(tree(path))
        if isinstance(node, ast.Constant) and node.value in (1.96, 1.959963984540054)
    ]
    assert len(found) == 1, found


HEAVY = "viser rerun pandas trimesh yourdfpy"
SLOW = "scipy.interpolate scipy.io scipy.optimize scipy.signal scipy.stats"  # up to half a second each


@pytest.mark.parametrize(
    "code, unused",
    [
        ("import flexviz", f"{HEAVY} pyarrow pinocchio scipy numpy"),
        ("import flexviz.outlets.terminal", f"{HEAVY} pyarrow pinocchio scipy numpy"),
        ("import flexviz.analysis.diagnosis, flexviz.data.importing", f"{HEAVY} {SLOW}"),
    ],
)
def test_import_is_light(code: str, unused: str) -> None:
    program = f"{code}, sys; print([m for m in {unused.split()} if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


def test_everything_exported_exists() -> None:
    import flexviz

    for name in flexviz.__all__:
        assert getattr(flexviz, name) is not None
    assert set(flexviz._WHERE) | {"__version__"} == set(flexviz.__all__)
    with pytest.raises(AttributeError, match="no_such_thing"):
        flexviz.no_such_thing  # noqa: B018
