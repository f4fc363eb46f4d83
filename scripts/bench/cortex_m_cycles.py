#!/usr/bin/env python3
"""Counts the instructions of a sample of a controller on an ARM Cortex-M, and estimates its cycles.

    aso-ftc design PLANT.toml --c-code FOLDER [--float]
    scripts/bench/cortex_m_cycles.py FOLDER [--cpu cortex-m7]

Needs arm-none-eabi-gcc and qemu-system-arm (Debian: gcc-arm-none-eabi, qemu-system-arm). The controller is compiled with
-O2 and runs 40 samples in QEMU, which writes the address of every instruction. Measurements and references swing about the
operating point, so that limits are reached; a scheduling variable moves over its range; each actuator that may be gone is
gone for some samples, and the fall-back is in force for some. Each instruction counts with the cycles of the Technical
Reference Manual of the Cortex-M4 (ARM DDI 0439, tables 3-1 and 7-1): loads and stores 2, of several registers one more than
their number, divisions of integers 12, VDIV and VSQRT 14, VMLA 3, branches that are taken 3, the rest 1. Memory without wait states is
assumed. Of a Cortex-M7, which issues up to two instructions at once, only the instructions are counted.
"""

import argparse
import re
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

FLAGS = "-std=c99 -O2 -ffp-contract=off -mthumb -ffreestanding"
CPUS = {
    "cortex-m3": ("-mcpu=cortex-m3 -mfloat-abi=soft", "mps2-an385"),
    "cortex-m4": ("-mcpu=cortex-m4 -mfloat-abi=hard -mfpu=fpv4-sp-d16", "mps2-an386"),
    "cortex-m7": ("-mcpu=cortex-m7 -mfloat-abi=hard -mfpu=fpv5-d16", "mps2-an500"),
}
SAMPLES = 40
# The instructions of the floating-point unit.
ARITHMETIC = {"multiplications": r"vn?mul", "additions": r"v(add|sub)", "divisions": r"vdiv"}

LAYOUT = """
ENTRY(start)
SECTIONS {
  .text 0 : { KEEP(*(.vectors)) *(.text*) *(.rodata*) }
  .data 0x20000000 : { *(.data*) *(.bss*) *(COMMON) }
}
"""

MAIN = """
#include "%(name)s.h"
extern void start(void);
__attribute__((section(".vectors"), used)) static const void *const vectors[] = {(void *)0x20010000, start};
static %(name)s_State state;
static volatile %(real)s offset[4] = {0, 1, 0, -1};
__attribute__((noinline)) void run(void)
{
    %(name)s_Measurements y;
    %(name)s_Commands u;
    %(name)s_Estimates estimates;
%(variables)s
    %(name)s_init(&state);
    for (uint32_t k = 0; k < %(samples)dU; k++)
    {
        %(real)s *values = (%(real)s *)&y;
        for (uint32_t i = 0; i < %(capital)s_MEASUREMENTS; i++)
        {
            values[i] = state.y[i] + offset[(k + i) %% 4U];
        }
%(inputs)s
        (void)%(name)s_step(&state, &y, %(before)strue%(reset)s, &u, &estimates%(after)s);
    }
}
void start(void)
{
    *(volatile uint32_t *)0xE000ED88 = 0xF00000U; /* the floating-point unit on */
    run();
    __asm volatile("mov r0, #0x18\\n ldr r1, =0x20026\\n bkpt 0xAB" ::: "r0", "r1", "memory");
    for (;;) {}
}
"""

# Of each structure in a header, in the order of the arguments: variables, what a sample sets, arguments before
# `compensate`, after it, at the end.
PARTS = {
    "References": (
        "    %(name)s_References r;",
        """        for (uint32_t i = 0; i < %(capital)s_REFERENCES; i++)
        {
            ((%(real)s *)&r)[i] = state.r[i] + offset[(k + i) %% 4U];
        }""",
        "&r, ", "", "",
    ),
    "Schedule": (
        "    %(name)s_Schedule theta;",
        "        *(%(real)s *)&theta = %(first)s + (%(real)s)k * ((%(last)s - %(first)s) / %(samples)d);",
        "&theta, ", "", "",
    ),
    "Detection": ("    %(name)s_Detection detection;", "", "", ", false", ", &detection"),
    "Actuators": (
        "    %(name)s_Actuators actuators;\n    int32_t reconfiguration;",
        """        for (uint32_t i = 0; i < sizeof(actuators); i++)
        {
            ((bool *)&actuators)[i] = (k / 3U) %% (sizeof(actuators) + 1U) == i + 1U;
        }""",
        "&actuators, ", "", ", &reconfiguration",
    ),
}  # fmt: skip


def program(header, names):
    """A program that takes the samples with all arguments of the controller with this header."""
    parts = [part for kind, part in PARTS.items() if f"}} {names['name']}_{kind};" in header]
    text = " ".join(header.replace("\n *", "").split())
    match = re.search(r"points from (\S+) to (\S+), and change", text)
    suffix = "F" if names["real"] == "float" else ""
    ends = dict(zip(("first", "last"), (f"{end}{suffix}" for end in match.groups()))) if match else {}
    variables, inputs, before, reset, after = ([part[k] for part in parts] for k in range(5))
    joined = {"variables": "\n".join(variables), "inputs": "\n".join(inputs)}
    joined |= {"before": "".join(before), "reset": "".join(reset), "after": "".join(after)}
    return MAIN % {**names, **{key: value % {**names, **ends} for key, value in joined.items()}}


def run(*command, **options):
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, **options)
    if done.returncode:
        sys.exit(f"{command[0]} ends with status {done.returncode}: {done.stderr}")
    return done.stdout


def cycles(mnemonic, operands, jump):
    """Cycles of an instruction of the Cortex-M4."""
    several = operands.count(",") + 1 if "{" in operands else 0
    spans = sum(int(b) - int(a) for a, b in re.findall(r"[rsd](\d+)-[rsd](\d+)", operands))
    words = 2 if re.search(r"\{.*d\d", operands) else 1
    if re.match(r"(push|pop|ldm|stm|vpush|vpop|vldm|vstm)", mnemonic):
        return 1 + words * (several + spans) + 3 * ("pc" in operands)
    if re.match(r"(ldrd|strd)", mnemonic) or (re.match(r"v(ldr|str)", mnemonic) and operands.startswith("d")):
        return 3
    if re.match(r"(v?ldr|v?str)", mnemonic):
        return 2
    if re.match(r"(vdiv|vsqrt)", mnemonic):
        return 14
    if re.match(r"(vmla|vmls|vfma|vfms)", mnemonic):
        return 3
    if re.match(r"(sdiv|udiv)", mnemonic):
        return 12
    if jump:
        return 3
    return 1


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="the folder of --c-code")
    parser.add_argument("--cpu", choices=CPUS, default="cortex-m4")
    options = parser.parse_args()
    [source] = options.folder.glob("*.c")
    target, board = CPUS[options.cpu]
    compiler = ["arm-none-eabi-gcc", *FLAGS.split(), *target.split()]
    names = {
        "name": source.stem,
        "capital": source.stem.upper(),
        "real": "float" if " float " in source.read_text(encoding="ascii") else "double",
        "samples": SAMPLES,
    }
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        header = source.with_suffix(".h").read_text(encoding="ascii")
        (home / "main.c").write_text(program(header, names), encoding="ascii")
        (home / "layout.ld").write_text(LAYOUT, encoding="ascii")
        run(*compiler, "-c", source, "-o", home / "own.o")
        size = run("arm-none-eabi-size", home / "own.o").splitlines()[1].split()[0]
        linked = ["-I", options.folder, home / "main.c", home / "own.o", "-nostdlib", "-T", home / "layout.ld", "-lgcc"]
        run(*compiler, *linked, "-o", home / "own.elf")
        traced = ["-singlestep", "-d", "exec,nochain", "-D", home / "trace"]
        board = ["qemu-system-arm", "-M", board, "-display", "none", "-semihosting", "-kernel", home / "own.elf"]
        run(*board, *traced, timeout=60)
        trace = [int(pc, 16) for pc in re.findall(r"\[\w+/(\w+)/", (home / "trace").read_text())]
        listing = run("arm-none-eabi-objdump", "-d", "--no-show-raw-insn", home / "own.elf")
    code, first = {}, None
    for line in listing.splitlines():
        if match := re.match(r"\s*([0-9a-f]+):\t(\S+)\s*(.*)", line):
            code[int(match[1], 16)] = match[2], match[3]
        elif line.endswith(f"<{source.stem}_step>:"):
            first = int(line.split()[0], 16)
    order = sorted(code)
    after = dict(zip(order, order[1:]))
    caller = next(pc for pc, (name, operands) in code.items() if name == "bl" and f"<{source.stem}_step>" in operands)
    samples, kinds, inside = [], Counter(), False
    for at, pc in enumerate(trace):
        if pc == first:
            samples.append(Counter())
            inside = True
        elif pc == after[caller]:
            inside = False
        if inside and at + 1 < len(trace):
            mnemonic, operands = code[pc]
            count = cycles(mnemonic, operands.split(";")[0], trace[at + 1] != after.get(pc))
            samples[-1].update({"instructions": 1, "cycles": count})
            kinds[mnemonic.split(".")[0]] += 1
            samples[-1].update(kind for kind, pattern in ARITHMETIC.items() if re.match(pattern, mnemonic))
    assert len(samples) == SAMPLES, f"{len(samples)} samples in the trace"
    most = max(samples, key=lambda sample: sample["cycles"])
    print(f"{source.stem}, {names['real']}, {options.cpu}: program and constants {size} bytes")
    estimate = f", about {most['cycles']} cycles, {1e6 * most['cycles'] / 168e6:.1f} us at 168 MHz"
    print(f"a sample: at most {most['instructions']} instructions{'' if options.cpu == 'cortex-m7' else estimate}")
    counts = {kind: max(sample[kind] for sample in samples) for kind in ARITHMETIC}
    if any(counts.values()):
        print("of them, at most: " + ", ".join(f"{count} {kind}" for kind, count in counts.items()))
    print("most frequent: " + ", ".join(f"{name} {count // SAMPLES}" for name, count in kinds.most_common(8)))


if __name__ == "__main__":
    main()
