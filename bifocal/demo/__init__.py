"""The whole workflow on a sample pair with exact truth."""

from pathlib import Path

#: Where the sample lies: far.jpg, near.jpg, facade.pair.json, targets.csv, the exact relief
#: truth.tif, and seen.png, white where both cameras see the wall.
SAMPLE = Path(__file__).with_name("sample")
#: The same of a façade under water, a fifth as large, through flat ports and coastal haze.
WATER_SAMPLE = Path(__file__).with_name("sample_water")

__all__ = ["SAMPLE", "WATER_SAMPLE"]
