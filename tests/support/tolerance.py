"""The tolerances of the tests, each with its reason. EPSILON is the spacing of doubles at 1."""

from __future__ import annotations

import sys

EPSILON = sys.float_info.epsilon

#: A value computed from the same numbers in another order of operations: a few roundings.
ROUNDING = 8 * EPSILON

#: One flight of the exact flow against 40 digits, per unit of the largest term. The flow sums exp, sin and cos of
#: arguments up to about ten, each rounded.
FLOW = 32 * EPSILON

#: An orbit's fixed point after its transient has decayed: a flow's rounding, amplified by 1 / (1 - multiplier).
ORBIT = 1e-13

#: The phase of the orbit after 10^6 periods. A phase from the absolute time would lose more digits; time is kept as
#: whole periods + rest.
LONG_PHASE = 1e-12

#: A sequence of a few dozen impacts from a given start against 40 digits; chatter contracts.
SEQUENCE = 1e-12

#: The next impact after a release. The flow leaves the stop with displacement, velocity and acceleration 0. So the
#: impact's time and velocity carry the error of the release over some forcing periods.
AFTER_RELEASE = 1e-10

#: The same orbit in other step sizes. Every communication point adds one rounding of the state, and the multipliers of
#: the tested orbits are below 1.
PARTITION = 1e-11

#: Numbers printed in a reference with 14 digits, or with 12.
PRINTED_14 = 5e-14
PRINTED_12 = 5e-12

#: First differences with a step of about 1e-6: the truncation is 1e-12 and the rounding 1e-10.
DIFFERENCES = 1e-8
