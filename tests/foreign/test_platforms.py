"""The FMUs of scripts/cross and the wheels of scripts/wheel --platform: each binary runs on its platform,
or its file is examined.

Libraries for Linux run directly and with an old glibc, those for Windows under wine, those for ARM
Linux under qemu. Files for macOS are examined only. The folder of the FMUs is target/cross/dist, or
the one that the environment variable PLATFORM_FMUS names; PLATFORM_WHEEL names a wheel.
"""

import hashlib
import json
import os
import shlex
import signal
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import lief
import numpy as np
import pytest
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from fmpy import read_model_description
from fmpy.util import add_remoting

STEPS = 5000
MODELS = {"plant": "FrictionPendulum", "controller": "AsoController"}
CONNECTED = ("x_p", "theta", "u")
# The root of another glibc, and a compiler for it, if scripts/cross has installed them.
GLIBC = Path(os.environ.get("OLD_GLIBC") or "/nowhere")
ZIG = shlex.split(os.environ.get("ZIG", ""))
LIBRARIES = GLIBC / "lib" / "x86_64-linux-gnu"
# For each platform: how the host is compiled, and how it is run.
RUN: dict[str, tuple[str, list, list]] = {
    "linux64": ("linux64", ["cc"], []),
    "glibc 2.31": (
        "linux64",
        [*ZIG, "cc", "-target", "x86_64-linux-gnu.2.17"],
        [LIBRARIES / "ld-linux-x86-64.so.2", "--library-path", LIBRARIES],
    ),
    "win64": ("win64", ["x86_64-w64-mingw32-gcc", "-static"], ["wine"]),
    "aarch64-linux": (
        "aarch64-linux",
        ["aarch64-linux-gnu-gcc"],
        ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"],
    ),
}
SUFFIX = {"linux64": "so", "win64": "dll", "darwin64": "dylib", "aarch64-linux": "so"}
SUFFIX["aarch64-darwin"] = "dylib"
# The names of platforms in FMI 3.0.
TUPLES = {"linux64": "x86_64-linux", "win64": "x86_64-windows", "darwin64": "x86_64-darwin"}
# Libraries that every Windows 10 has.
WINDOWS = {"kernel32.dll", "ntdll.dll", "msvcrt.dll", "bcryptprimitives.dll"}
WINDOWS |= {"api-ms-win-core-synch-l1-2-0.dll"}
LINUX = {"libc.so.6", "libm.so.6", "libpthread.so.0", "libdl.so.2"}
LINUX |= {"ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"}


@pytest.fixture(scope="session")
def fmus(root):
    """The FMUs of scripts/cross, by role."""
    folder = Path(os.environ.get("PLATFORM_FMUS", root / "target" / "cross" / "dist"))
    paths = {role: folder / f"{model}.fmu" for role, model in MODELS.items()}
    for path in paths.values():
        assert path.is_file(), f"{path} is missing: run scripts/cross --out {folder} first"
    return paths


def binary(fmus, role, platform):
    """The name of a library in its FMU; skips the test if it was not built."""
    name = f"binaries/{platform}/{MODELS[role]}.{SUFFIX[platform]}"
    if name not in zipfile.ZipFile(fmus[role]).namelist():
        pytest.skip(f"scripts/cross was not asked for {platform}")
    return name


@pytest.fixture(scope="session")
def wine(tmp_path_factory):
    """Variables for wine in a folder of its own, with the one library that wine 8 lacks."""
    folder = tmp_path_factory.mktemp("wine")
    variables = {"WINEPREFIX": str(folder / "prefix"), "WINEARCH": "win64", "WINEDEBUG": "-all"}
    # FMPy calls wine by this name.
    (folder / "wine64").write_text('#!/bin/sh\nexec wine "$@"\n')
    (folder / "wine64").chmod(0o755)
    variables["PATH"] = f"{folder}:{os.environ['PATH']}"
    environment = {**os.environ, **variables}
    subprocess.run(["wineboot", "--init"], env=environment, check=True, capture_output=True)
    # Windows' random numbers, from the function that wine uses internally.
    source = folder / "bcryptprimitives.c"
    source.write_text(
        "#include <windows.h>\n#include <ntsecapi.h>\n"
        "__declspec(dllexport) BOOL ProcessPrng(PBYTE bytes, SIZE_T count)\n"
        "{ return RtlGenRandom(bytes, (ULONG)count); }\n"
    )
    target = folder / "prefix" / "drive_c" / "windows" / "system32" / "bcryptprimitives.dll"
    if not target.exists():
        compiler = ["x86_64-w64-mingw32-gcc", "-shared", "-o", target, source, "-ladvapi32"]
        subprocess.run(compiler, check=True)
    yield environment
    subprocess.run(["wineserver", "-k"], env=environment, check=False)


def words(fmu, library, folder, windows):
    """The arguments of the host for an FMU."""
    description = read_model_description(str(fmu))
    reference = {v.name: str(v.valueReference) for v in description.modelVariables}
    drive = "Z:" if windows else ""
    uri = f"file:///{drive}{folder / 'resources'}".replace("////", "///")
    if description.fmiVersion == "3.0":
        uri = f"{drive}{folder / 'resources'}/"
    return [f"{drive}{library}", description.guid, uri, *(reference[name] for name in CONNECTED)]


def of_fmi_3(fmu):
    """The FMU of FMI 3.0 beside one of FMI 2.0."""
    return fmu.with_suffix(".fmi3.fmu")


def compiled(where, source, folder):
    """A program in C for a platform."""
    platform, compiler, _ = RUN[where]
    windows = platform == "win64"
    program = folder / f"{source.stem}{'.exe' if windows else ''}"
    options = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-o", program, source]
    subprocess.run([*compiler, *options, *([] if windows else ["-ldl"])], check=True)
    return program


@pytest.fixture(scope="session")
def hosted(fmus, root, tmp_path_factory, request):
    """The output of the host on each platform, with the binaries in the FMUs."""
    printed = {}

    def run(where):
        if where not in printed:
            platform, _, runner = RUN[where]
            folder = tmp_path_factory.mktemp(platform)
            windows = platform == "win64"
            program = compiled(where, root / "tests" / "platforms" / "host.c", folder)
            arguments = [str(STEPS)]
            for role, fmu in fmus.items():
                name = binary(fmus, role, platform)
                zipfile.ZipFile(fmu).extractall(folder / role)
                arguments += words(fmu, folder / role / name, folder / role, windows)
            environment = request.getfixturevalue("wine") if windows else None
            command = [*runner, program, *arguments]
            done = subprocess.run(command, capture_output=True, text=True, env=environment)
            assert done.returncode == 0, f"{where}: {done.stdout}\n{done.stderr}"
            printed[where] = done.stdout.replace("\r\n", "\n")
        return printed[where]

    return run


def skip_unless_built(fmus, where):
    """Skips the test if scripts/cross did not build or install what it needs."""
    if where == "glibc 2.31" and not GLIBC.is_dir():
        pytest.skip("scripts/cross --test got no glibc 2.31")
    binary(fmus, "plant", RUN[where][0])


@pytest.mark.parametrize("where", RUN)
def test_the_interface_holds_on_each_platform(fmus, hosted, where):
    skip_unless_built(fmus, where)
    text = hosted(where)
    assert text.endswith("done\n") and "FAILED" not in text


@pytest.mark.parametrize("where", RUN)
def test_the_closed_loop_has_the_bits_of_the_fmus_for_this_machine(
    fmus, hosted, where, packed, unpacked, root
):
    skip_unless_built(fmus, where)
    lines = lambda text: [line for line in text.splitlines() if line.startswith("step ")]
    assert len(lines(hosted(where))) == 10
    assert lines(hosted(where)) == lines(native(packed, unpacked, root))


@pytest.mark.parametrize("where", RUN)
def test_the_closed_loop_of_fmi_3_has_the_bits_of_fmi_2(fmus, hosted, where, root, tmp_path, request):
    skip_unless_built(fmus, where)
    platform, _, runner = RUN[where]
    windows = platform == "win64"
    arguments = [str(STEPS)]
    for role, fmu in fmus.items():
        folder = tmp_path / role
        zipfile.ZipFile(of_fmi_3(fmu)).extractall(folder)
        library = folder / "binaries" / TUPLES.get(platform, platform) / f"{MODELS[role]}.{SUFFIX[platform]}"
        arguments += words(of_fmi_3(fmu), library, folder, windows)
    environment = request.getfixturevalue("wine") if windows else None
    command = [*runner, compiled(where, root / "tests" / "platforms" / "loop3.c", tmp_path), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    lines = done.stdout.replace("\r\n", "\n").splitlines()
    assert done.returncode == 0 and lines[-1] == "done", f"{where}: {done.stdout}\n{done.stderr}"
    assert lines[:-1] == [line for line in hosted(where).splitlines() if line.startswith("step ")]


@pytest.mark.parametrize("role", MODELS)
def test_the_archives_of_both_versions_have_the_same_platforms(fmus, role):
    """Their names differ, and darwin64 of FMI 2.0 has both machines."""
    platforms = [
        {name.split("/")[1] for name in zipfile.ZipFile(fmu).namelist() if name.startswith("binaries/")}
        for fmu in (fmus[role], of_fmi_3(fmus[role]))
    ]
    assert {TUPLES.get(name, name) for name in platforms[0]} == platforms[1]


def native(packed, unpacked, root):
    """The output of the host with the FMUs of `aso-ftc pack`, built for this machine alone."""
    program = Path(unpacked["plant"].path).parent / "host"
    source = root / "tests" / "platforms" / "host.c"
    subprocess.run(["cc", "-std=c11", "-O2", "-o", program, source, "-ldl"], check=True)
    arguments = [str(STEPS)]
    for role, fmu in packed.items():
        library = Path(unpacked[role].path)
        arguments += words(fmu, library, library.parents[2], False)
    return subprocess.run([program, *arguments], capture_output=True, text=True, check=True).stdout


SIMULATE = """
import sys, numpy
from fmpy import simulate_fmu
settings = {"fmi_type": "CoSimulation", "stop_time": 1.0, "output_interval": 0.01}
numpy.save(sys.argv[2], simulate_fmu(sys.argv[1], **settings))
"""


def simulated(fmu, target, environment=None):
    """FMPy's results of an FMU, from a process of its own.

    FMPy 0.3.32 and its server sometimes wait for each other for ever, if the one connects while the
    other starts to listen. The test then starts them again.
    """
    command = [sys.executable, "-c", SIMULATE, fmu, target]
    # The pages for a browser are built at the same time.
    for patience in (20, 20, 40, 40, 80, 80, 160):
        child = subprocess.Popen(command, env=environment, start_new_session=True)
        try:
            assert child.wait(timeout=patience) == 0
            return np.load(target)
        except subprocess.TimeoutExpired:
            os.killpg(child.pid, signal.SIGKILL)
            child.wait()
            subprocess.run(["wineserver", "-k"], env=environment, check=False)
    raise AssertionError("FMPy never got through to its server")


@pytest.mark.parametrize("role", MODELS)
def test_fmpys_windows_server_gives_the_results_of_linux(fmus, packed, role, wine, tmp_path):
    binary(fmus, role, "win64")
    alone = tmp_path / "windows.fmu"
    with zipfile.ZipFile(fmus[role]) as whole, zipfile.ZipFile(alone, "w") as part:
        for name in whole.namelist():
            if not name.startswith("binaries/") or name.startswith("binaries/win64/"):
                part.writestr(name, whole.read(name))
    add_remoting(str(alone), "linux64", "win64")
    here = simulated(packed[role], tmp_path / "here.npy")
    there = simulated(alone, tmp_path / "there.npy", wine)
    assert len(there) == 101 and there.dtype == here.dtype
    assert there.tobytes() == here.tobytes()


def test_the_master_for_windows_writes_the_results_file_of_linux(fmus, packed, aso_ftc, wine, tmp_path):
    command = os.environ.get("WINDOWS_COMMAND")
    if not command:
        pytest.skip("scripts/cross was not asked for aso-ftc.exe")
    for role in MODELS:
        binary(fmus, role, "win64")
    options = ["run", "--stop-time", "100", "--record-every", "0.01"]
    drive = [f"--{role}=Z:{path}" for role, path in fmus.items()]
    program = ["wine", command, *options, *drive, f"--out=Z:{tmp_path / 'windows'}"]
    done = subprocess.run(program, env=wine, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    here = [f"--{role}={path}" for role, path in packed.items()]
    done = aso_ftc(*options, *here, f"--out={tmp_path / 'linux'}")
    assert done.returncode == 0, done.stderr
    windows, linux = (tmp_path / name / "results.csv" for name in ("windows", "linux"))
    assert linux.read_bytes().count(b"\n") == 10_002
    assert windows.read_bytes() == linux.read_bytes()


@pytest.mark.parametrize("role", MODELS)
@pytest.mark.parametrize("platform", SUFFIX)
def test_only_the_functions_of_fmi_are_exported(fmus, role, platform):
    library = zipfile.ZipFile(fmus[role]).read(binary(fmus, role, platform))
    for part in slices(library):
        names = exported(part)
        others = {name for name in names if not name.startswith(("fmi2", "fmi3"))}
        if isinstance(part, lief.ELF.Binary):
            assert len(names - others) == 44 and others <= {"fmuDescribe"}, names
        else:
            assert len(names - others) == 44 + 75 and others == {"fmuDescribe", "fmuDescribe3"}, names


def slices(library):
    """The binaries in a file: one, or one for each machine of macOS."""
    parsed = lief.parse(list(library))
    if isinstance(parsed, lief.MachO.Binary):
        whole = lief.MachO.parse(list(library))
        machines = [part.header.cpu_type for part in whole]
        # Copied, because the parts become invalid together with the file.
        return [whole.take(machine) for machine in machines]
    return [parsed]


def exported(part):
    """The names that a loader can find."""
    if isinstance(part, lief.ELF.Binary):
        return {symbol.name for symbol in part.exported_symbols}
    if isinstance(part, lief.PE.Binary):
        return {entry.name for entry in part.get_export().entries}
    trie = part.dyld_exports_trie if part.has_dyld_exports_trie else part.dyld_info
    # On macOS, C names start with an underscore.
    return {info.symbol.name.removeprefix("_") for info in trie.exports}


@pytest.mark.parametrize("role", MODELS)
@pytest.mark.parametrize("platform", ["linux64", "aarch64-linux"])
def test_linux_needs_glibc_of_2012_and_nothing_else(fmus, role, platform):
    (part,) = slices(zipfile.ZipFile(fmus[role]).read(binary(fmus, role, platform)))
    assert set(part.libraries) <= LINUX
    versions = [
        tuple(map(int, entry.name.removeprefix("GLIBC_").split(".")))
        for needed in part.symbols_version_requirement
        for entry in needed.get_auxiliary_symbols()
    ]
    assert versions and max(versions) <= (2, 17)


@pytest.mark.parametrize("role", MODELS)
def test_windows_needs_system_libraries_only(fmus, role):
    (part,) = slices(zipfile.ZipFile(fmus[role]).read(binary(fmus, role, "win64")))
    assert {name.lower() for name in part.libraries} <= WINDOWS
    assert part.header.time_date_stamps == 0


@pytest.mark.parametrize("role", MODELS)
@pytest.mark.parametrize("platform", ["darwin64", "aarch64-darwin"])
def test_macos_finds_the_needed_libraries_in_each_part(fmus, role, platform):
    parts = slices(zipfile.ZipFile(fmus[role]).read(binary(fmus, role, platform)))
    machines = {part.header.cpu_type.name: part for part in parts}
    assert set(machines) == ({"X86_64", "ARM64"} if platform == "darwin64" else {"ARM64"})
    for machine, part in machines.items():
        library, *others = part.libraries
        assert library.name == f"@rpath/{MODELS[role]}.dylib"
        assert [other.name for other in others] == ["/usr/lib/libSystem.B.dylib"]
        least = part.version_min.version if part.has_version_min else part.build_version.minos
        assert least[:2] == ([11, 0] if machine == "ARM64" else [10, 12])
        well_formed, fault = lief.MachO.check_layout(part)
        assert well_formed, fault


@pytest.mark.parametrize("role", MODELS)
@pytest.mark.parametrize("platform", ["darwin64", "aarch64-darwin"])
def test_the_signature_for_arm_macs_has_the_hash_of_each_page(fmus, role, platform):
    library = zipfile.ZipFile(fmus[role]).read(binary(fmus, role, platform))
    (part,) = [part for part in slices(library) if part.header.cpu_type.name == "ARM64"]
    start = part.fat_offset
    begin = start + part.code_signature.data_offset
    blob = library[begin : begin + part.code_signature.data_size]
    word = lambda at: int.from_bytes(blob[at : at + 4], "big")
    assert word(0) == 0xFADE0CC0  # a list of blobs
    directories = [word(16 + 8 * k) for k in range(word(8)) if word(12 + 8 * k) == 0]
    (at,) = directories
    assert word(at) == 0xFADE0C02  # a code directory
    flags, hashes, pages, limit = word(at + 12), word(at + 16), word(at + 28), word(at + 32)
    size, kind, page = blob[at + 36], blob[at + 37], 1 << blob[at + 39]
    assert flags & 2 and (size, kind) == (32, 2)  # without a certificate; SHA-256
    assert limit == part.code_signature.data_offset and pages == -(-limit // page)
    for k in range(pages):
        code = library[start + k * page : start + min((k + 1) * page, limit)]
        stated = blob[at + hashes + 32 * k :][:32]
        assert hashlib.sha256(code).digest() == stated, f"page {k}"


def test_checksums_and_bills_of_materials_match_the_fmus(fmus):
    folder = fmus["plant"].parent
    done = subprocess.run(["sha256sum", "--check", "SHA256SUMS"], cwd=folder, capture_output=True)
    assert done.returncode == 0 and done.stdout.count(b": OK") == 9
    for fmu in fmus.values():
        text = fmu.with_suffix(".cdx.json").read_text(encoding="utf-8")
        assert JsonStrictValidator(SchemaVersion.V1_5).validate_str(text) is None
        bill = json.loads(text)
        assert bill["metadata"]["component"]["name"] == fmu.stem
        listed = {f"{part['name']}-{part.get('version')}" for part in bill["components"]}
        texts = zipfile.ZipFile(fmu).namelist()
        paths = [name.split("/") for name in texts if name.startswith("documentation/licenses/")]
        packed = {parts[2] for parts in paths if len(parts) > 3}
        assert {name for name in packed if not name.startswith("rust-")} <= listed


@pytest.fixture
def wheel(tmp_path):
    """The folder of the package in the wheel of scripts/wheel --platform, unpacked."""
    path = os.environ.get("PLATFORM_WHEEL")
    if not path:
        pytest.skip("scripts/wheel --platform NAME --test sets PLATFORM_WHEEL")
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path / "wheel")
    return tmp_path / "wheel" / "aso_ftc"


@pytest.fixture
def wheel_command(wheel, request):
    """Runs the command of a wheel for Windows or ARM Linux; returns the finished process."""
    command = next((wheel / "bin").iterdir())
    command.chmod(0o755)
    windows = command.suffix == ".exe"
    environment = request.getfixturevalue("wine") if windows else None
    runner = RUN["win64" if windows else "aarch64-linux"][2]

    def run(*words):
        return subprocess.run([*runner, command, *words], env=environment, capture_output=True, text=True)

    return run


def test_the_module_in_the_wheel_exports_the_function_that_python_calls(wheel):
    (module,) = [path for path in wheel.glob("_core.*") if path.suffix in (".so", ".pyd")]
    (part,) = slices(module.read_bytes())
    assert "PyInit__core" in exported(part)


def test_the_command_in_the_wheel_has_the_version_of_the_wheel(wheel, wheel_command):
    (information,) = wheel.parent.glob("aso_ftc-*.dist-info")
    version = information.stem.removeprefix("aso_ftc-")
    done = wheel_command("--version")
    assert done.stdout.split()[:2] == ["aso-ftc", version], done.stderr


def test_the_command_in_the_wheel_writes_the_results_file_of_linux(
    wheel, wheel_command, packed, aso_ftc, tmp_path
):
    drive = "Z:" if (wheel / "bin" / "aso-ftc.exe").exists() else ""
    options = ["run", "--stop-time", "20", "--record-every", "0.01"]
    arguments = [f"--{role}={drive}{wheel / 'fmus' / model}.fmu" for role, model in MODELS.items()]
    done = wheel_command(*options, *arguments, f"--out={drive}{tmp_path / 'there'}")
    assert done.returncode == 0, done.stderr
    here = [f"--{role}={path}" for role, path in packed.items()]
    done = aso_ftc(*options, *here, f"--out={tmp_path / 'here'}")
    assert done.returncode == 0, done.stderr
    there, here = (tmp_path / name / "results.csv" for name in ("there", "here"))
    assert here.read_bytes().count(b"\n") == 2_002
    assert there.read_bytes() == here.read_bytes()


def test_the_command_in_the_wheel_places_the_eigenvalues_of_the_plant_file(
    wheel, wheel_command, root, tmp_path
):
    drive = "Z:" if (wheel / "bin" / "aso-ftc.exe").exists() else ""
    plant = root / "fmu-controller" / "pendulum.toml"
    done = wheel_command("design", f"{drive}{plant}", "--out", f"{drive}{tmp_path / 'design.toml'}")
    # The verdict on the paper's design is red.
    assert done.returncode == 1, done.stderr
    required = tomllib.loads(plant.read_text(encoding="utf-8"))
    design = tomllib.loads((tmp_path / "design.toml").read_text(encoding="utf-8"))
    a, b, c, f, k, l_x, l_f = (np.array(design[name]) for name in ("A", "B", "C", "F_a", "K_x", "L_x", "L_f"))
    eigenvalues = np.sort(np.linalg.eigvals(a + b @ k))
    assert np.allclose(eigenvalues, np.sort(required["feedback"]["eigenvalues"]), rtol=1e-8)
    augmented = np.block([[a, f], [np.zeros((1, 5))]]) - np.vstack([l_x, l_f]) @ np.hstack(
        [c, np.zeros((2, 1))]
    )
    eigenvalues = np.sort(np.linalg.eigvals(augmented))
    assert np.allclose(eigenvalues, np.sort(required["observer"]["eigenvalues"]), rtol=1e-8)
