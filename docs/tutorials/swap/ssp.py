"""Simulates an SSP in FMPy and prints the largest value of each output of the plant, and the one at the end.

Usage: python docs/tutorials/swap/ssp.py SYSTEM.ssp
"""

import sys

from fmpy.ssp.simulation import simulate_ssp

result = simulate_ssp(sys.argv[1], stop_time=20.0, step_size=1e-3)
for name in result.dtype.names:
    if name.startswith("plant."):
        print(f"{name}: largest {abs(result[name]).max():.4g}, at the end {abs(result[name][-1]):.2g}")
