"""The false alarms of the wind turbine's monitor: a measure of campaign.toml."""

# Each alarm with the time of its fault. An alarm that ends up to 3 s after its fault is no false one.
FAULTS = {
    "fault_beta_m1[1]": (2000, 2100),
    "fault_beta_m2[2]": (2300, 2400),
    "fault_beta_m1[3]": (2600, 2700),
    "fault_omega_r_m[1]": (1500, 1600),
    "fault_omega_r_m[2]": (1000, 1100),
    "fault_omega_g_m[1]": (1000, 1100),
    "fault_pitch[2]": (2900, 3000),
    "fault_pitch[3]": (3400, 3500),
    "fault_converter": (3800, 3900),
}
OTHERS = ["fault_beta_m1[2]", "fault_beta_m2[1]", "fault_beta_m2[3]", "fault_omega_g_m[2]", "fault_pitch[1]"]


def seconds(results, _values):
    """Returns for how many seconds there is an alarm without its fault, summed over the alarms."""
    time = results["time"]
    total = 0.0
    for name in [*FAULTS, *OTHERS]:
        alarm = results[f"monitor.{name}"].astype(bool)
        start, end = FAULTS.get(name, (0, 0))
        total += 0.01 * float((alarm & ~((time > start - 1e-6) & (time < end + 3))).sum())
    return total
