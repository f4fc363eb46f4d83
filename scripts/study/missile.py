"""The missile of examples/plants/schedule/missile.toml: its nonlinear equations, their rest positions and linearisations.

    python scripts/study/missile.py

prints the points of the schedule. The pitch axis of a tail-controlled missile at 20,000 ft, a benchmark of gain scheduling:
R. A. Nichols, R. T. Reichert and W. J. Rugh, Gain scheduling for H-infinity controllers: a flight control example, IEEE
Transactions on Control Systems Technology 1 (1993). With alpha and delta in degrees within the coefficients,

    alpha'  = q + Q S C_n cos(alpha) / (m v)             C_n = a_n alpha^3 + b_n alpha |alpha| + c_n (2 - M/3) alpha + d_n delta
    q'      = Q S d C_m / I_y                            C_m = a_m alpha^3 + b_m alpha |alpha| + c_m (-7 + 8 M/3) alpha + d_m delta
    delta'' = omega^2 (u - delta) - 2 zeta omega delta'  eta = Q S C_n / m

with v = M v_s and the dynamic pressure Q = 0.7 p M^2; p and v_s are those of the standard atmosphere (ISO 2533), not the rounded ones
of the paper. The accelerometer is at the centre of mass. Needs Python 3.11 with
numpy and scipy.
"""

import numpy as np
from scipy.optimize import brentq

# In m and kg: reference area, diameter, mass and moment of inertia.
FOOT, SLUG = 0.3048, 14.59390294
AREA, LENGTH, MASS, INERTIA = 0.44 * FOOT**2, 0.75 * FOOT, 13.98 * SLUG, 182.5 * SLUG * FOOT**2
# The coefficients of C_n and C_m, for angles in degrees.
A_N, B_N, C_N, D_N = 0.000103, -0.00945, -0.1696, -0.034
A_M, B_M, C_M, D_M = 0.000215, -0.0195, 0.051, -0.206
# The fin, and the air at 20,000 ft.
OMEGA, ZETA = 150.0, 0.7
GRAVITY = 9.80665
TEMPERATURE = 288.15 - 0.0065 * 20000 * FOOT
PRESSURE = 101325 * (TEMPERATURE / 288.15) ** (GRAVITY / (0.0065 * 287.05287))
SOUND = np.sqrt(1.4 * 287.05287 * TEMPERATURE)
MACH = (2.0, 2.5, 3.0, 3.5, 4.0)
ALPHA = np.radians(10)


def coefficients(alpha, delta, mach):
    """C_n and C_m; angles in rad."""
    a, d = np.degrees(alpha), np.degrees(delta)
    odd = lambda three, two, one: three * a**3 + two * a * abs(a) + one * a
    return (
        odd(A_N, B_N, C_N * (2 - mach / 3)) + D_N * d,
        odd(A_M, B_M, C_M * (-7 + 8 * mach / 3)) + D_M * d,
    )


def derivatives(x, u, mach):
    """x' for x = [alpha, q, delta, delta'] in rad and s."""
    alpha, q, delta, rate = x
    c_n, c_m = coefficients(alpha, delta, mach)
    force = 0.7 * PRESSURE * mach**2 * AREA
    return np.array([
        q + force / (MASS * mach * SOUND) * c_n * np.cos(alpha),
        force * LENGTH / INERTIA * c_m,
        rate,
        OMEGA**2 * (u - delta) - 2 * ZETA * OMEGA * rate,
    ])


def outputs(x, mach):
    """The normal acceleration eta in m/s^2, and q."""
    c_n, _ = coefficients(x[0], x[2], mach)
    return np.array([0.7 * PRESSURE * mach**2 * AREA / MASS * c_n, x[1]])


def rest(mach):
    """x and u at the constant angle of attack of the schedule."""
    delta = brentq(lambda delta: coefficients(ALPHA, delta, mach)[1], -1, 1, xtol=1e-15)
    q = -derivatives(np.array([ALPHA, 0, delta, 0]), delta, mach)[0]
    return np.array([ALPHA, q, delta, 0.0]), delta


def linearised(mach):
    """A, B, C, x_op, u_op and y_op: central differences of the equations, whose error is below 1e-8 of the largest entry."""
    (x, u), step = rest(mach), 1e-5
    columns = [(derivatives(x + step * e, u, mach) - derivatives(x - step * e, u, mach)) / (2 * step) for e in np.eye(4)]
    output_columns = [(outputs(x + step * e, mach) - outputs(x - step * e, mach)) / (2 * step) for e in np.eye(4)]
    return np.array(columns).T, np.array([[0.0], [0], [0], [OMEGA**2]]), np.array(output_columns).T, x, u, outputs(x, mach)


def main():
    number = lambda value: f"{value:.9g}"
    row = lambda values: "[" + ", ".join(number(value) for value in values) + "]"
    for mach in MACH:
        a, _, c, x, u, y = linearised(mach)
        print(f"[[schedule.points]]\nat = {mach}")
        for name, matrix in (("A", a), ("C", c)):
            print(f"{name} = [\n" + "".join(f"    {row(values)},\n" for values in matrix) + "]")
        print(f"x_op = {row(x)}\nu_op = {row([u])}\ny_op = {row(y)}\n")


if __name__ == "__main__":
    main()
