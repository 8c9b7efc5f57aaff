"""What calibration leaves of effects that captures.json has no tolerance for, rms over the signal, as parts of the flat
field's.

Fifteen captured scenes without any effect, by another engine and with the declared errors (benchmarks/blind, and the
bench's null), are e^110 to e^175 times likelier so than where each effect may do half a flat field's tolerance and each
family without a name a sixth of it: 0.15 % each, which many of them together multiply. Edges keep more: pixels, lenses
and renderings agree on them less well than on what is smooth. On the bench at 480 x 360 two cases without a glare
had 0.16 and 0.19 % of one, in one camera.
"""

import numpy as np

SMOOTH = 1 / 12  # an effect that is smooth over the image
LAMP = 1 / 3  # a lamp's beam, which is measured as a flat field is
EDGED = 1 / 4  # one that changes edges
# the shadows of one lamp, which are a small part of images: on the bench 0.15 % of its light, where captures of one
# lamp show 0.0 to 0.1 %. As much as EDGED would be 2 %, which captures of all lamps tell no better
SHADOWED = EDGED / 16
SCATTERED = (
    0.0015  # of the signal, not of a flat field's: what every lens scatters at least and no data sheet tells
)
# of the signal: what a response that is called linear is off a line by. The EMVA 1288 reference camera's is by four to
# seven times as much; less than that is how bright dark places are, which renderers differ by, too
BENT = 5e-4
REFLECTED = 1 / 4  # light by way of other surfaces, which path tracers leave noise in
UNNAMED = 1 / 24  # a family that no calibration looks at


def falling(waves: list[tuple[int, int]]) -> dict[tuple[int, int], float]:
    """Shares of a smooth field's rms by its cosines (i, j), whose squares add up to 1: it has the more of a wave the
    longer that is, as 1 / (i² + j²)."""
    height = {w: 1.0 / (w[0] ** 2 + w[1] ** 2) for w in waves}
    total = float(np.sqrt(sum(x * x for x in height.values())))
    return {w: x / total for w, x in height.items()}
