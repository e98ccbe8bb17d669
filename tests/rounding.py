"""The unit of rounding, in which tests say how exactly numbers must agree.

A float64 operation is off by at most EPS / 2 of its result, but the last digits are not the same
on every processor: each has its own kernels of linear algebra, sin and exp of the C library
may be off by one EPS, a fused multiply-add rounds once where others round twice, and threads add in
another order. A tolerance is therefore a multiple of EPS times the magnitude of what is compared:

4 EPS
    A number written and read back, or a formula of a few operations.
8 EPS
    A formula of some ten operations, or two ways through one, each with its own rounding.
16 EPS
    A few formulas in a row, an inverse, or products of matrices.

`.ci/processors` runs the tests as other processors compute them; none used more than half of its
tolerance there. A fault in a formula is thousands of times larger than any of these.
"""

import numpy as np

EPS = float(np.finfo(float).eps)
