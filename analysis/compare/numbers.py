"""How far two images differ as numbers, in their own linear unit (DN, radiance, ...).

    rms² = mean (b - a)²,  bias = mean (b - a),  PSNR = 20 log10(peak / rms)

SSIM by Wang, Bovik, Sheikh, Simoncelli: Image quality assessment: from error visibility to structural similarity. IEEE
Trans. Image Processing 13(4), 2004; Gaussian window of 1.5 px. It is blind to small smooth differences: read rms first.
"""

from dataclasses import dataclass

import numpy as np
from skimage.metrics import structural_similarity

from interchange.image import Image, Quantity, same_quantity

PEAK = 99.9  # percentile of the reference that stands for white where there is no highest DN


@dataclass(frozen=True)
class Difference:
    """``b`` less ``a``. ``rms``, ``bias`` and ``worst`` in ``unit``; ``rms_percent`` of a's mean; ``psnr_dB`` over
    ``peak`` (infinite for equal images); ``gain``, ``offset``: the line b = gain a + offset that fits best."""

    unit: str
    rms: float
    bias: float
    worst: float
    rms_percent: float
    peak: float
    psnr_dB: float
    ssim: float
    gain: float
    offset: float


def peak_of(image: Image) -> float:
    """What white is: the highest DN that occurs in ``bits``, else a high percentile."""
    bits = int(image.made_by.get("bits", 0))
    if image.quantity is Quantity.DN and bits:
        most = float(image.pixels.max())
        known = [2**n - 1 for n in (8, 10, 12, 14, 16) if 2**n - 1 >= most and n <= bits]
        return float(known[0] if known else 2**bits - 1)
    return float(max(np.percentile(image.pixels, PEAK), 1e-30))


def difference(a: Image, b: Image) -> Difference:
    """``a`` is the reference. Raises BrightfieldError where quantity or size differ."""
    same_quantity(a, b)
    x, y = a.pixels.astype(np.float64), b.pixels.astype(np.float64)
    e = y - x
    rms, peak = float(np.sqrt(np.mean(e**2))), max(peak_of(a), peak_of(b))
    spread = float(np.var(x))
    gain = float(np.mean((x - x.mean()) * (y - y.mean())) / spread) if spread > 0 else 1.0
    smallest = min(x.shape[:2])
    similarity = structural_similarity(  # type: ignore[no-untyped-call]
        x, y, data_range=peak, channel_axis=2, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
    ) if smallest >= 11 else float("nan")  # fmt: skip
    mean = float(x.mean())
    return Difference(
        unit=a.quantity.unit,
        rms=rms,
        bias=float(e.mean()),
        worst=float(e.flat[np.argmax(np.abs(e))]),
        rms_percent=100 * rms / mean if mean > 0 else float("nan"),
        peak=peak,
        psnr_dB=float(20 * np.log10(peak / rms)) if rms > 0 else float("inf"),
        ssim=float(similarity),
        gain=gain,
        offset=float(y.mean() - gain * x.mean()),
    )
