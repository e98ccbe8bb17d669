"""Relief of one point from two radial distances, with the library and with a pocket calculator.

    python examples/relief_by_hand.py

35 mm lens at 17.5 m, 19 mm lens at 9.5 m: both photos are 1:500. A point 2 m from the nadir that
stands out 1 m is seen at 35 * 2 / 16.5 and 19 * 2 / 8.5 mm.
"""

import bifocal

d1, d2 = 17.5, 9.5  # [m]
s1, s2 = 4.242424, 4.470588  # [mm]

r = float(bifocal.relief(s1, s2, d1=d1, d2=d2))
e1, e2 = (float(e) for e in bifocal.relief_displacements(s1, s2, d1=d1, d2=d2))
by_hand = (s2 - s1) / (s2 / d2 - s1 / d1)
print(f"r  = {r:.4f} m, by hand {by_hand:.4f} m")
print(f"e1 = {e1:.4f} mm, e2 = {e2:.4f} mm; without relief the point is at {s1 - e1:.4f} mm")
