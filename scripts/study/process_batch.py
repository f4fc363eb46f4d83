"""Designs plants of industrial processes with delays, as a table in Markdown.

    python scripts/study/process_batch.py [PI | PID]

The plants are of the nine families of the test batch of K. J. Astrom and T. Hagglund, Revisiting the Ziegler-Nichols step
response method for PID control, J. Process Control 14 (2004), with 133 sets of parameters, those of `batch`. Each is given to
`aso-ftc design` with the delay at the command, in continuous and in sampled time; a sample is a 40th of the longest time
constant or of the delay. The files state no requirement, or a PI or PID controller whose `bandwidth` is a third of the
frequency at which the plant has a phase of -135 degrees, at most half a radian per sample; then gamma is in the table, too.
The peaks of S are those with the delays themselves. Needs target/release/aso-ftc and Python 3.11 with scipy.
"""

import re
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from scipy.signal import tf2ss

from command import design

SAMPLES = 40


def lags(*times):
    """The product of all 1 + s T, as a polynomial."""
    product = np.array([1.0])
    for time in times:
        product = np.polymul(product, [time, 1.0])
    return product


def batch():
    """Name of the family, numerator, denominator, delay in s."""
    times = [0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.3, 1.5, 2, 4, 6, 8, 10, 20, 50, 100, 200, 500]
    for time in [0.02, *times, 1000]:
        yield "e^-s / (1 + s T)", [1], lags(time), 1
    for time in [0.01, 0.02, *times]:
        yield "e^-s / (1 + s T)^2", [1], lags(time, time), 1
    for time in [0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 2, 5, 10]:
        yield "1 / ((s + 1) (1 + s T)^2)", [1], lags(1, time, time), 0
    for order in range(3, 9):
        yield "1 / (s + 1)^n", [1], lags(*[1] * order), 0
    for part in np.arange(1, 10) / 10:
        yield "1 / ((1 + s) (1 + a s) (1 + a^2 s) (1 + a^3 s))", [1], lags(1, part, part**2, part**3), 0
    delays = [0.01, 0.02, 0.05, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0]
    for delay in delays:
        yield "e^-sL / (s (1 + s T)), T + L = 1", [1], np.polymul([1, 0], lags(1 - delay)), delay
    for time in [1, 2, 5, 10]:
        for delay in delays:
            yield "T e^-sL / ((1 + s T) (1 + s T1)), T1 + L = 1", [time], lags(time, 1 - delay), delay
    for zero in np.arange(1, 12) / 10:
        yield "(1 - a s) / (s + 1)^3", [-zero, 1], lags(1, 1, 1), 0
    for time in np.arange(1, 11) / 10:
        yield "1 / ((s + 1) ((s T)^2 + 1.4 s T + 1))", [1], np.polymul([1, 1], [time**2, 1.4 * time, 1]), 0


def bandwidth(numerator, denominator, delay):
    """A third of the frequency at which the phase of the plant is -135 degrees."""
    omega = np.geomspace(1e-5, 1e5, 200_000)
    response = np.polyval(numerator, 1j * omega) / np.polyval(denominator, 1j * omega)
    phase = np.unwrap(np.angle(response)) - delay * omega
    return omega[np.argmax(phase <= -0.75 * np.pi)] / 3


def plant_file(plant, sampled, structure):
    """The text of the plant file."""
    _, numerator, denominator, delay = plant
    a, b, c, _ = (matrix.tolist() for matrix in tf2ss(numerator, np.trim_zeros(denominator, "f")))
    text = f'A = {a}\nB = {b}\nC = {c}\nactuators = [{{ name = "u", delay = {delay} }}]\nactuator_faults = "all"\n'
    fastest = np.inf
    if sampled:
        slowest = max([delay, *(1 / abs(pole.real) for pole in np.roots(denominator) if abs(pole.real) > 1e-9)])
        period = float(f"{slowest / SAMPLES:.2g}")
        text += f"sample_time = {period}\n"
        fastest = 0.499 / period
    if structure:
        rate = min(bandwidth(numerator, denominator, delay), fastest)
        text += f'reference.track = ["y1"]\n[loop]\nbandwidth = {rate:.4g}\nstructure = "{structure}"\n'
    return text


def designed(text):
    """Verdict, peak of S and gamma; the message of a refusal."""
    try:
        report, _ = design(text, "--certificate-time", "1")
    except RuntimeError as refusal:
        return "refused", str(refusal), np.nan
    robustness = report["robustness"]
    exact = robustness["delays"] or {"s_peaks": [point["s_peak"] for point in robustness["points"]]}
    gamma = re.search(r"gamma = ([0-9.e+-]+[0-9])", report["feedback"]["method"])
    return report["verdict"]["level"], max(exact["s_peaks"]), float(gamma[1]) if gamma else np.nan


def main():
    """Prints a row for each family."""
    plants, structure = list(batch()), next(iter(sys.argv[1:]), None)
    heads = ["plant", "plants", "green, continuous", "green, sampled", "peak of S", *(["gamma"] if structure else [])]
    print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    with ThreadPoolExecutor() as pool:
        results = [
            list(pool.map(designed, [plant_file(plant, sampled, structure) for plant in plants]))
            for sampled in (False, True)
        ]
    for family in dict.fromkeys(plant[0] for plant in plants):
        rows = [at for at, plant in enumerate(plants) if plant[0] == family]
        green = [sum(results[sampled][at][0] == "green" for at in rows) for sampled in (0, 1)]
        peaks = [result[at][1] for result in results for at in rows if result[at][0] != "refused"]
        cells = [family, len(rows), *green, f"{min(peaks):.2f} to {max(peaks):.2f}"]
        if structure:
            gammas = [result[at][2] for result in results for at in rows if result[at][0] != "refused"]
            cells.append(f"{min(gammas):.2f} to {max(gammas):.2f}")
        print(f"| {' | '.join(map(str, cells))} |")
    for result in results:
        for plant, (level, detail, _) in zip(plants, result, strict=True):
            if level != "green":
                print(f"{plant[0]}, {[float(one) for one in plant[2]]}, {plant[3]} s: {level} {detail}")


if __name__ == "__main__":
    main()
