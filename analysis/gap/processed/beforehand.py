"""What is told of captures before anything is fitted, and the captures without it: pixels that are taken together, a
screen's curve, a JPEG and a colour matrix that the scene file does not say.

What is left is fitted; what was taken back is in the verdict as effects that are known, and in the corrected scene.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from analysis.gap.compared.conditions import Condition, conditions, must_fit
from analysis.gap.finding import Finding
from analysis.gap.judgement.findings import CROSSTALK, CURVE, JPEG, Known, with_known
from analysis.gap.judgement.verdict import Verdict, against, further
from analysis.gap.light.radiance import Rendered
from analysis.gap.measures.edges import Edges
from analysis.gap.noise.codes import with_steps
from analysis.gap.processed.binned import Binning, binned_captures, binning_of
from analysis.gap.processed.compressed import Compressed, grounds, processings, qualities, with_errors
from analysis.gap.processed.compressed import notes as notes_on_jpegs
from analysis.gap.processed.declared import Declared, without_declared
from analysis.gap.processed.encoded import Encoding, encoded, is_linear, parameters
from analysis.gap.processed.encoded import grounds as grounds_of_curves
from analysis.gap.processed.matrices import GROUNDS as MIXED
from analysis.gap.processed.matrices import (
    WORDS,
    Matrix,
    as_mixed,
    encoded_above,
    linear_above,
    matrices,
    mixed_further,
    numbers,
    unmixed,
)
from analysis.gap.processed.means import compressed_files, own_pixels, with_errors_of_means
from analysis.gap.processed.mosaics import must_say_its_mosaic
from analysis.gap.processed.overlap import must_overlap, with_files_bits
from analysis.gap.processed.own_pixels import edges_of_own_pixels, of_own_pixels
from analysis.gap.processed.own_pixels import notes as notes_on_pixels
from analysis.gap.processed.processing import notes as notes_on_mosaics
from analysis.gap.processed.surroundings import without_surroundings
from analysis.gap.processed.taken_as import Told, on_scene, taken_as
from interchange.camera import Camera
from interchange.captures import Captures
from interchange.formats.document import Document
from interchange.scene import Scene

Drawn = Callable[[Sequence[Condition]], Sequence[Rendered]]


@dataclass(frozen=True, eq=False)
class Beforehand:
    """``conditions``: what is fitted to, rendered; ``own``: captures of all pixels of the sensors, which ``by`` takes
    together. ``packed``, ``encodings`` and ``mixed``: the cameras whose captures are JPEGs, follow a curve or went
    through a matrix; ``said``: cameras by their conditions' names, as the scene file has them. ``around``: notes of
    surroundings and of mosaics; ``says``: what the file says that was taken back."""

    captures: Captures
    conditions: tuple[Condition, ...]
    own: Captures
    by: Binning
    packed: tuple[Compressed, ...]
    encodings: tuple[Encoding, ...]
    mixed: tuple[Matrix, ...]
    said: dict[str, Camera]
    says: Declared
    around: tuple[str, ...] = ()

    def document(self, document: Document) -> Document:
        """A scene file as its cameras were fitted: without what it says that was taken back, and binned."""
        return self.by.document(self.says.document(document))

    def scene(self, scene: Scene) -> Scene:
        """A scene of the sensors' own pixels as what was fitted says it."""
        return mixed_further(on_scene(self.by.on_scene(scene), (*self.packed, *self.encodings)), self.mixed)

    def known(self, v: Verdict, held: Sequence[Condition]) -> tuple[Verdict, list[Known]]:
        """The verdict against the file as written, and the effects that are between that and what was fitted to.
        ``held``: the conditions that were held out."""
        known: list[Known] = []
        after = list(zip(held, v.shown.after, strict=True))

        def chi(simulated: Sequence[np.ndarray]) -> float:
            return sqrt(v.by.chi2(simulated))

        if self.packed:
            least, names = v.gap.before**2, [x.camera for x in self.packed]
            off = [self._unpacked(c) - c.simulated().dn for c in held]
            v = further(v, off)
            told, taken_off = qualities(self.packed), v.gap.before**2 - least
            lacking = [dn + x for (_, dn), x in zip(after, off, strict=True)]
            known.append(Known(JPEG, told, grounds(self.packed), taken_off, chi(lacking), self._alone(names)))
        if self.mixed:
            least = v.gap.before**2
            v = against(v, [as_mixed(c, dn, self.mixed) for c, dn in zip(held, v.shown.before, strict=True)])
            cameras = self._alone([m.camera for m in self.mixed])
            lacking = [as_mixed(c, dn, self.mixed) for c, dn in after]
            known.append(Known(CROSSTALK, {}, MIXED, v.gap.before**2 - least, chi(lacking), cameras, WORDS))
        if self.encodings:
            least, curved = v.gap.before**2, {s.camera for s in self.encodings}
            written = [replace(c, camera=self.said[c.name]).simulated().dn for c in held]
            v = against(
                v,
                [
                    dn if c.camera.name in curved else as_mixed(c, dn, self.mixed)
                    for c, dn in zip(held, written, strict=True)
                ],
            )
            cameras, why = self._alone(sorted(curved)), grounds_of_curves(self.encodings)
            lacking = [self._straight(c, dn) if c.camera.name in curved else dn for c, dn in after]
            taken_off = v.gap.before**2 - least
            known.append(Known(CURVE, parameters(self.encodings), why, taken_off, chi(lacking), cameras))
        return v, known

    def with_known(self, found: Sequence[Finding], known: Sequence[Known], v: Verdict) -> list[Finding]:
        """What was found, with what was known."""
        out = list(found)
        for k in known:
            more = next((f.parameters for f in out if f.name == k.name), {})
            if k.name == CROSSTALK:  # with what the fit adds to it
                k = replace(k, parameters=numbers(self.mixed, more))
            if k.name == CURVE:  # a gamma, which the fit knows better
                k = replace(k, parameters={n: more.get(n, x) for n, x in k.parameters.items()})
            out = with_known(out, k, v.gap)
        return out

    def of_own_pixels(
        self, found: Sequence[Finding], edges: Edges | None
    ) -> tuple[list[Finding], Edges | None]:
        """Findings and edges in the sensors' own pixels."""
        if self.by.n == 1:
            return list(found), edges
        return [of_own_pixels(f, self.by) for f in found], edges and edges_of_own_pixels(edges, self.by)

    @property
    def notes(self) -> list[str]:
        return [
            *self.around,
            *notes_on_jpegs(self.packed, [m.camera for m in self.mixed]),
            *notes_on_pixels(self.own, self.by),
        ]

    def _straight(self, c: Condition, dn: np.ndarray) -> np.ndarray:
        """DN of a condition as they are by the curve that the file says."""
        return encoded_above(linear_above(dn, c.camera), self.said[c.name])

    def _unpacked(self, c: Condition) -> np.ndarray:
        """(H, W, C) simulated DN of a camera whose images are as they were before they were compressed."""
        sensor = replace(c.camera.sensor, jpeg_quality=self.said[c.name].sensor.jpeg_quality)
        return replace(c, camera=replace(c.camera, sensor=sensor)).simulated().dn

    def _alone(self, own: Sequence[str]) -> tuple[str, ...]:
        """The cameras that have something, where others have not."""
        return tuple(own) if {c.camera.name for c in self.conditions} - set(own) else ()


def beforehand(captures: Captures, document: Document, binning: int, drawn: Drawn) -> Beforehand:
    """``drawn`` renders conditions; ``binning``: pixels across that are taken as one. Raises BrightfieldError where
    captures and scene do not belong together."""
    must_fit(captures, document)
    plain = without_declared(captures, document)
    own, unbinned = plain.captures, plain.document
    must_say_its_mosaic(own, unbinned.scene())
    by = binning_of(own, unbinned, binning)

    def taken(of: Captures, told: Sequence[Told] = ()) -> tuple[Captures, list[Condition]]:
        few, document = (
            (binned_captures(of, unbinned, by, told), by.document(unbinned)) if by.n > 1 else (of, unbinned)
        )
        return few, with_steps(with_files_bits(conditions(few, document)))

    captures, found = taken(own)
    rendered = drawn(found)
    pixels = own_pixels(own, unbinned.scene(), by.n)
    averaged = by.averaged > 1 and not by.colours
    packed = [] if by.colours else compressed_files(own, pixels)
    of_files = () if averaged else packed  # blocks are of the sensors' own pixels
    whole, around = without_surroundings(
        taken_as([replace(c, rendered=r) for c, r in zip(found, rendered, strict=True)], of_files)
    )
    must_overlap(whole)
    encodings = encoded(whole)

    def again(of: Captures) -> tuple[Captures, list[Condition], list[Condition]]:
        few, anew = taken(of, encodings)
        compared = zip(anew, rendered, whole, strict=True)
        return few, anew, [replace(c, rendered=r, mask=c.mask & w.mask) for c, r, w in compared]

    if encodings and by.averaged > 1:  # means are of light
        captures, found, whole = again(own)
    linear = {c.camera.name for c in whole if is_linear(c.camera.sensor)}
    as_taken = taken_as(whole, encodings)
    mixed = matrices([c for c in as_taken if c.camera.name in linear])
    if mixed:
        pure = unmixed(own, {c.camera.name: c.camera for c in as_taken}, mixed)
        captures, found, whole = again(pure)
    said = {c.name: c.camera for c in found}
    whole = taken_as(whole, (*of_files, *encodings))
    if averaged:
        whole, before = with_errors_of_means(
            whole, pixels.told((*packed, *encodings)), plain.processed, mixed
        )
    else:
        told = processings(whole, mixed, plain.processed)
        whole, before = with_errors(whole, told), list(told.values())
    return Beforehand(
        captures,
        tuple(whole),
        own,
        by,
        tuple(packed),
        tuple(encodings),
        tuple(mixed),
        said,
        plain.says,
        (*around, *notes_on_mosaics(before)),
    )
