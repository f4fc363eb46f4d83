"""Plants of the test batch of Astrom and Hagglund: what the tables of the book say of all of them holds for these."""

import pytest

from process_batch import batch, designed, plant_file

FAMILIES = {}
for one in batch():
    FAMILIES.setdefault(one[0], []).append(one)


@pytest.mark.parametrize("structure", [None, "PI"])
@pytest.mark.parametrize("family", FAMILIES)
def test_the_middle_plant_of_each_family_gets_a_loop_without_a_high_peak_of_s(family, structure):
    plant = FAMILIES[family][len(FAMILIES[family]) // 2]
    # Every other family in samples.
    sampled = (list(FAMILIES).index(family) + (structure is None)) % 2 == 1
    level, peak, _ = designed(plant_file(plant, sampled, structure))
    assert level == "green" and 1.0 < peak < 2.0, peak
