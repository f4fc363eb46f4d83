"""The source code of sampled controllers on an ARM Cortex-M: compiled, and executed in QEMU."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from code_cases import CASES, Built, run, stated
from conftest import ROOT
from design_loop import packed_plant

TOOLS = [shutil.which(name) for name in ("arm-none-eabi-gcc", "arm-none-eabi-objdump", "qemu-system-arm")]


@pytest.mark.skipif(not shutil.which("arm-none-eabi-gcc"), reason="no compiler for ARM Cortex-M: gcc-arm-none-eabi")
@pytest.mark.parametrize("options", [[], ["--float"]], ids=["double", "float"])
def test_it_compiles_for_a_cortex_m(aso_ftc, tmp_path, options):
    Built(aso_ftc, CASES["constant-prediction"].text, tmp_path, *options)
    target = "-mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 -ffreestanding".split()
    always = "-std=c99 -O2 -ffp-contract=off -Wall -Wextra -Wconversion -Werror".split()
    run("arm-none-eabi-gcc", *always, *target, "-c", tmp_path / "c" / "plant.c", "-o", tmp_path / "m4.o")
    undefined = subprocess.check_output(["arm-none-eabi-nm", "-u", tmp_path / "m4.o"], text=True)
    needed = {line.split()[-1] for line in undefined.splitlines()}
    assert not needed if options else needed and all(name.startswith("__aeabi_d") for name in needed), needed


DEBIAN = [Path("/usr/bin/cargo"), Path("/usr/bin/rustc"), Path("/usr/lib/rustlib/src/rust")]


@pytest.mark.skipif(
    not all(path.exists() for path in DEBIAN) or not shutil.which("arm-none-eabi-nm"),
    reason="no Rust compiler with the sources of core: rustc-web, cargo-web, rust-web-src, gcc-arm-none-eabi",
)
def test_the_crate_is_built_for_a_cortex_m_and_nothing_in_it_panics(aso_ftc, tmp_path):
    """The crates of several designs, with `core` from its sources, for a Cortex-M4 or M7 with a floating-point unit."""
    packed_plant(aso_ftc, "ThreeTank")
    members = {}
    for name, options in [
        ("constant-prediction", []),
        ("sensor-fault", ["--float"]),
        ("scheduled-drive", ["--float"]),
        ("scheduled-by-measurement", []),
        ("detection-cusum", []),
        ("detection-window", ["--float"]),
        ("fall-back", ["--float"]),
        ("fall-back-alone", []),
        ("reconfiguration-detection", []),
        ("proportional-integral-schedule", []),
        ("fast-adaptive", ["--float"]),
        ("sliding-mode-detection", []),
        ("feedthrough", []),
    ]:
        (folder := tmp_path / name).mkdir()
        members[name] = Built(aso_ftc, CASES[name].text, folder, *options, name=name.replace("-", "_"))
    listed = ", ".join(f'"{name}/rust"' for name in members)
    (tmp_path / "Cargo.toml").write_text(f'[workspace]\nresolver = "2"\nmembers = [{listed}]\n', encoding="utf-8")
    cargo, rustc, _ = map(str, DEBIAN)
    options = ["--release", "--workspace", "--target", "thumbv7em-none-eabihf", "-Z", "build-std=core"]
    homes = {name: os.environ[name] for name in ("HOME", "CARGO_HOME") if name in os.environ}
    tools = {"PATH": "/usr/bin:/bin", "RUSTC": rustc, "RUSTC_BOOTSTRAP": "1", "RUSTFLAGS": "-D warnings", **homes}
    done = subprocess.run([cargo, "build", *options], cwd=tmp_path, env=tools, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for controller in members.values():
        library = tmp_path / "target" / "thumbv7em-none-eabihf" / "release" / f"lib{controller.name}.rlib"
        listed = [line.split() for line in subprocess.check_output(["arm-none-eabi-nm", library], text=True).splitlines()]
        needed = {words[-1] for words in listed if words[:1] == ["U"]} - {words[2] for words in listed if len(words) == 3}
        numbers = () if controller.single else ("__aeabi_d", "__aeabi_ui2d")
        memory = ("__aeabi_mem", "memcpy", "memset", "memcmp", "bcmp")
        assert (controller.single or needed) and all(name.startswith((*numbers, *memory)) for name in needed), needed


@pytest.mark.skipif(not all(TOOLS), reason="no Cortex-M: gcc-arm-none-eabi, qemu-system-arm")
@pytest.mark.parametrize(
    "name",
    ["reference", "scheduled-drive", "scheduled-by-measurement", "detection-cusum", "fall-back-alone", "transfer-reconfiguration",
     "proportional-integral-sensor", "fast-adaptive-schedule", "sliding-mode-detection", "feedthrough"],
)  # fmt: skip
def test_no_sample_has_more_operations_than_the_header_states(aso_ftc, packed, tmp_path, name):
    """The instructions of the floating-point unit in QEMU. The compiler leaves out products with 1 and the sum of -0 and a number."""
    packed_plant(aso_ftc, "ThreeTank")
    controller = Built(aso_ftc, CASES[name].text, tmp_path, "--float")
    done = subprocess.run([ROOT / "scripts" / "bench" / "cortex_m_cycles.py", controller.folder / "c"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    most = {kind: int(re.search(rf"(\d+) {kind}", done.stdout).group(1)) for kind in ("multiplications", "additions", "divisions")}
    limits = stated(controller)
    assert all(count <= limits[kind] for kind, count in most.items()), (most, limits)
    assert most["divisions"] == limits["divisions"]
    assert most["multiplications"] > 0.9 * limits["multiplications"] and most["additions"] > 0.75 * limits["additions"]
