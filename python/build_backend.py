"""Builds the Python package: `python -m pip install ./python` calls these functions (PEP 517, PEP 660).

A wheel contains the Python files, the extension module, the command aso-ftc, the FMUs of the paper and the
licences of the crates in them. One call of cargo builds module and command, so that no crate is compiled twice;
maturin writes the metadata. scripts/wheel makes wheels for other platforms with the same functions.

Environment: BUILT_PROGRAMS names the folder of a finished build; nothing is compiled then.
"""

import base64
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

PYTHON = Path(__file__).resolve().parent
ROOT = PYTHON.parent
WORK = ROOT / "target" / "wheel"
FMUS = ["FrictionPendulum.fmu", "AsoController.fmu"]
NOTICES = "THIRD-PARTY.txt"
LICENCE = re.compile(r"(licen[cs]e|copying|notice|unlicense)", re.IGNORECASE)
# By the system of sys.platform: the file names of the command, the library of cargo and the extension module.
NAMES = {
    "linux": ("aso-ftc", "lib_core.so", "_core.abi3.so"),
    "darwin": ("aso-ftc", "lib_core.dylib", "_core.abi3.so"),
    "win32": ("aso-ftc.exe", "_core.dll", "_core.pyd"),
}


def run(*command, **options):
    """Runs a command in the folder of the workspace; its failure ends this process."""
    words = [str(word) for word in command]
    status = subprocess.run(words, check=False, **{"cwd": ROOT, **options}).returncode
    if status != 0:
        sys.exit(f"aso-ftc: the wheel is not built: status {status} of {' '.join(words)}")


def notices(triple):
    """The licences of all crates that are linked into module and command, each text once."""
    words = ["cargo", "metadata", "--format-version=1", "--locked", "--filter-platform", triple]
    graph = json.loads(subprocess.check_output(words, cwd=ROOT))
    packages = {package["id"]: package for package in graph["packages"]}
    nodes = {node["id"]: node for node in graph["resolve"]["nodes"]}
    left = [key for key, package in packages.items() if package["name"] in ("aso-ftc", "aso-ftc-python")]
    linked = set()
    while left:
        key = left.pop()
        if key not in linked:
            linked.add(key)
            edges = nodes[key]["deps"]
            left += [edge["pkg"] for edge in edges if any(kind["kind"] is None for kind in edge["dep_kinds"])]
    texts = {}
    for package in sorted((packages[key] for key in linked), key=lambda one: (one["name"], one["version"])):
        if package["source"] is None:
            continue
        name = f"{package['name']} {package['version']} ({package['license']})"
        folder = Path(package["manifest_path"]).parent
        files = sorted(path for path in folder.iterdir() if LICENCE.match(path.name) and path.is_file())
        for text in [path.read_text(encoding="utf-8", errors="replace").strip() for path in files] or [""]:
            texts.setdefault(text, []).append(name)
    parts = ["\n".join([*names, "", text]) for text, names in texts.items()]
    return f"\n\n{'-' * 80}\n".join(["Software of others in this package.", *parts]) + "\n"


def binaries(system, triple, folder, fmus):
    """What the package has beside its Python files, by name: module and command from the folder of a build,
    FMUs from another one, licences."""
    command, library, module = NAMES[system]
    texts = WORK / NOTICES
    WORK.mkdir(parents=True, exist_ok=True)
    texts.write_text(notices(triple), encoding="utf-8")
    files = {f"aso_ftc/bin/{command}": folder / command, f"aso_ftc/{module}": folder / library}
    return {**files, f"aso_ftc/{NOTICES}": texts, **{f"aso_ftc/fmus/{name}": fmus / name for name in FMUS}}


def build():
    """Builds module, command and FMUs for this machine; returns the files as `binaries`."""
    if sys.platform not in NAMES:
        sys.exit(f"aso-ftc: the wheel is not built: the system is {sys.platform}, expected {', '.join(NAMES)}")
    if not shutil.which("cargo"):
        sys.exit("aso-ftc: the wheel is not built: cargo is not in PATH; install Rust 1.90 or later: https://rustup.rs")
    folder = Path(os.environ.get("BUILT_PROGRAMS") or ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release")
    if "BUILT_PROGRAMS" not in os.environ:
        # PyO3 is compiled again if the interpreter or PATH changes, and pip changes PATH each time.
        python = {"PYO3_PYTHON": getattr(sys, "_base_executable", sys.executable)}
        words = ["cargo", "build", "--release", "--locked", "--package", "aso-ftc", "--package", "aso-ftc-python"]
        run(*words, env={**python, **os.environ})
    command, library, _ = NAMES[sys.platform]
    run(folder / command, "pack", "--out", WORK / "fmus", stdout=subprocess.DEVNULL)
    if sys.platform == "linux":
        for name in (command, library):
            run("strip", "-o", WORK / name, folder / name)
        folder = WORK
    about = subprocess.check_output(["rustc", "-vV"], text=True, cwd=ROOT)
    return binaries(sys.platform, re.search(r"(?m)^host: (.*)$", about)[1], folder, WORK / "fmus")


def write_metadata(folder, maturin="maturin"):
    """Writes the metadata of a wheel below a folder; returns the .dist-info folder."""
    words = [maturin, "pep517", "write-dist-info", "--metadata-directory", folder]
    run(*words, "--interpreter", sys.executable, cwd=PYTHON, stdout=subprocess.DEVNULL)
    (info,) = Path(folder).glob("*.dist-info")
    return info


def write_wheel(folder, files, platform_tag=None, maturin="maturin"):
    """Writes a wheel of these files, by their names in it, and the metadata; returns the name of the wheel."""
    metadata = WORK / "metadata"
    shutil.rmtree(metadata, ignore_errors=True)
    metadata.mkdir(parents=True)
    info = write_metadata(metadata, maturin)
    text = (info / "WHEEL").read_text(encoding="utf-8")
    if platform_tag:
        text = re.sub(r"(?m)^(Tag: \w+-\w+)-.*$", rf"\1-{platform_tag}", text)
        (info / "WHEEL").write_text(text, encoding="utf-8")
    tag = re.search(r"(?m)^Tag: (.*)$", text)[1]
    files = {**files, **{str(path.relative_to(metadata)): path for path in info.rglob("*") if path.is_file()}}
    name, record = f"{info.stem}-{tag}.whl", f"{info.name}/RECORD"
    lines = []
    # In another folder, so that an interrupted call leaves nothing that looks whole.
    with zipfile.ZipFile(WORK / name, "w", zipfile.ZIP_DEFLATED) as archive:
        for member, path in sorted(files.items()):
            content = path.read_bytes()
            # The same files give the same wheel.
            entry = zipfile.ZipInfo(member.replace(os.sep, "/"))
            entry.external_attr = (0o100755 if path.stat().st_mode & 0o100 else 0o100644) << 16
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED)
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            lines.append(f"{entry.filename},sha256={digest},{len(content)}\n")
        archive.writestr(zipfile.ZipInfo(record), "".join([*lines, f"{record},,\n"]), zipfile.ZIP_DEFLATED)
    shutil.move(WORK / name, Path(folder) / name)
    return name


def sources():
    """The files of the package that are not built, by name."""
    built = {"bin", "fmus", NOTICES, "__pycache__", *(module for _, _, module in NAMES.values())}
    files = {path.relative_to(PYTHON): path for path in PYTHON.glob("aso_ftc/**/*") if path.is_file()}
    return {str(name): path for name, path in files.items() if not built.intersection(name.parts)}


def prepare_metadata_for_build_wheel(metadata_directory, config_settings=None):
    """Writes the metadata before anything is built."""
    return write_metadata(metadata_directory).name


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """Builds the wheel for this machine."""
    return write_wheel(wheel_directory, {**sources(), **build()})


prepare_metadata_for_build_editable = prepare_metadata_for_build_wheel


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    """Puts the built files beside the Python files; the wheel only names this folder."""
    for name, path in build().items():
        target = PYTHON / name
        target.parent.mkdir(exist_ok=True)
        shutil.copy(path, target)
    link = WORK / "aso_ftc.pth"
    link.write_text(f"{PYTHON}\n", encoding="utf-8")
    return write_wheel(wheel_directory, {link.name: link})


def build_sdist(sdist_directory, config_settings=None):
    """Refuses: the package has no source archive."""
    sys.exit("aso-ftc: the Python package has no source archive: its sources are the whole repository; build from a clone")
