"""What a COLLADA <effect> says: the common profile's terms, with parameters, samplers and images followed up."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from interchange.formats.collada.library import Library
from interchange.formats.collada.source import floats
from interchange.material import Wrap

MODELS = ("phong", "blinn", "lambert", "constant")
COLORS = ("emission", "ambient", "diffuse", "specular", "reflective", "transparent")
NUMBERS = ("shininess", "reflectivity", "transparency", "index_of_refraction")
WRAPS = {
    "WRAP": Wrap.REPEAT,
    "MIRROR": Wrap.MIRROR,
    "CLAMP": Wrap.CLAMP,
    "BORDER": Wrap.BLACK,
    "NONE": Wrap.BLACK,
    "MIRROR_ONCE": Wrap.MIRROR,
}


@dataclass(frozen=True)
class TextureUse:
    file: Path
    texcoord: str  # the semantic that an instance binds to a set of coordinates
    wrap: tuple[Wrap, Wrap]
    element: Any


@dataclass(frozen=True)
class Term:
    """A colour (4,) or a number (1,), or a texture in its place. ``element`` is what an animation may move."""

    value: np.ndarray
    texture: TextureUse | None = None
    element: Any = None


@dataclass(frozen=True)
class Appearance:
    model: str
    terms: dict[str, Term] = field(default_factory=dict)
    opaque: str = "A_ONE"
    glsl: str = ""

    def color(self, name: str, default: tuple[float, ...] = (0, 0, 0, 1)) -> Term:
        return self.terms.get(name, Term(np.array(default, np.float64)))


def read_effect(effect: Any, instance: Any, lib: Library) -> Appearance | None:
    """``instance``: the <instance_effect>, whose <setparam> replace parameters. None, with a finding, if it is bad."""
    common = effect.find("profile_COMMON")
    glsl = _fragment(effect)
    if common is None:
        if glsl:
            return Appearance("lambert", glsl=glsl)
        names = ", ".join(c.tag for c in effect if c.tag.startswith("profile_")) or "no profile"
        lib.find.loss(f"The effect has {names}; only profile_COMMON is drawn. It becomes mid grey.", effect)
        return Appearance("lambert", {"diffuse": Term(np.array([0.5, 0.5, 0.5, 1.0]))})
    scope = {p.get("sid"): p for p in (*effect.findall("newparam"), *common.findall("newparam"))}
    technique = common.find("technique")
    scope |= {} if technique is None else {p.get("sid"): p for p in technique.findall("newparam")}
    scope |= {p.get("ref"): p for p in instance.findall("setparam")}
    model = next((c for c in (() if technique is None else technique) if c.tag in MODELS), None)
    if model is None:
        lib.find.error(f"A common profile must hold one of {', '.join(MODELS)}.", common)
        return None
    terms: dict[str, Term] = {}
    for child in model:
        if child.tag in COLORS:
            term = _color(child, scope, lib)
        elif child.tag in NUMBERS:
            term = _number(child, scope, lib)
        else:
            lib.find.note(f"<{child.tag}> is no term of {model.tag}.", child)
            continue
        if term is not None:
            terms[child.tag] = term
    transparent = model.find("transparent")
    opaque = "A_ONE" if transparent is None else transparent.get("opaque", "A_ONE")
    if opaque not in ("A_ONE", "A_ZERO", "RGB_ZERO", "RGB_ONE"):
        lib.find.error(f'opaque must be A_ONE, A_ZERO, RGB_ZERO or RGB_ONE; got "{opaque}".', transparent)
        return None
    return Appearance(model.tag, terms, opaque, glsl)


def _fragment(effect: Any) -> str:
    """The GLSL ``vec3 brdf(vec3 wi, vec3 wo, vec2 uv)`` that a profile_GLSL holds, or nothing."""
    for code in effect.iterfind("profile_GLSL//code"):
        if "brdf(vec3 wi, vec3 wo, vec2 uv)" in " ".join((code.text or "").split()):
            return str(code.text).strip() + "\n"
    return ""


def _given(term: Any, scope: dict[str, Any]) -> Any:
    """The element that carries a term's value, behind <param ref>."""
    child = next((c for c in term if c.tag in ("color", "float", "texture", "param")), None)
    if child is None or child.tag != "param":
        return child
    param = scope.get(child.get("ref"))
    return None if param is None else next((c for c in param if c.tag.startswith("float")), None)


def _color(term: Any, scope: dict[str, Any], lib: Library) -> Term | None:
    given = _given(term, scope)
    if given is None:
        if len(term):
            lib.find.error(f"<{term.tag}> must hold a color, a texture or a param that is there.", term)
        return None
    if given.tag == "texture":
        texture = _texture(given, scope, lib)
        return None if texture is None else Term(np.ones(4), texture)
    values = floats(given, lib)
    if values is None:
        return None
    if len(values) not in (3, 4) or not np.isfinite(values).all():
        lib.find.error(f"<{term.tag}> must be 3 or 4 finite numbers; got {len(values)}.", given)
        return None
    return Term(np.append(values, 1.0)[:4], element=given)


def _number(term: Any, scope: dict[str, Any], lib: Library) -> Term | None:
    given = _given(term, scope)
    if given is None or given.tag == "texture":
        if len(term):
            lib.find.error(f"<{term.tag}> must hold a float or a param that is there.", term)
        return None
    values = floats(given, lib, 1)
    if values is None:
        return None
    if not np.isfinite(values).all():
        lib.find.error(f"<{term.tag}> must be a finite number.", given)
        return None
    return Term(values, element=given)


def _texture(texture: Any, scope: dict[str, Any], lib: Library) -> TextureUse | None:
    name = texture.get("texture") or ""
    wrap = [Wrap.REPEAT, Wrap.REPEAT]
    param = scope.get(name)
    sampler = None if param is None else param.find("sampler2D")
    image: Any = None
    if sampler is not None:
        for axis, tag in enumerate(("wrap_s", "wrap_t")):
            word = (sampler.findtext(tag) or "WRAP").strip()
            if word not in WRAPS:
                lib.find.error(f"<{tag}> must be one of {', '.join(WRAPS)}; got {word!r}.", sampler)
                return None
            wrap[axis] = WRAPS[word]
        border = (sampler.findtext("border_color") or "0").split()
        if Wrap.BLACK in wrap and any(c != 0 for c in _numbers(border)[:3]):
            lib.find.loss("A border colour that is not black is drawn black.", sampler)
        direct = sampler.find("instance_image")  # 1.5
        if direct is not None:
            image = lib.resolve(direct.get("url"), direct, "image")
        else:
            surface = scope.get((sampler.findtext("source") or "").strip())
            inner = None if surface is None else surface.find("surface")
            if inner is None:
                lib.find.error("A sampler2D must name a surface by its sid.", sampler)
                return None
            image = _surface_image(inner, lib)
    else:  # many writers name the image itself
        found = lib.by_id(name, texture)
        if found is not None and found.tag == "image":
            image = found
        else:
            lib.find.error(f'The texture "{name}" is no sampler2D of its effect and no image.', texture)
    if image is None:
        return None
    file = image_file(image, lib)
    if file is None:
        return None
    return TextureUse(file, texture.get("texcoord") or "", (wrap[0], wrap[1]), texture)


def _numbers(words: list[str]) -> list[float]:
    try:
        return [float(w) for w in words]
    except ValueError:
        return []


def _surface_image(surface: Any, lib: Library) -> Any:
    init = surface.find("init_from")
    if init is not None:
        name = (init.text or "").strip()
    else:
        init = surface.find("init_planar/all")
        name = "" if init is None else init.get("ref", "").strip()
    image = lib.by_id(name, surface) if name else None
    if image is None or image.tag != "image":
        lib.find.error(f'A surface must name an image that is there; got "{name}".', surface)
        return None
    return image


def image_file(image: Any, lib: Library) -> Path | None:
    """The file of an <image> of 1.4 or 1.5; None, with a finding, where there is none."""
    init = image.find("init_from")
    if init is None:
        init = image.find("create_2d/init_from")
    if init is None:
        lib.find.error("An image must name its file; images within the XML are not read.", image)
        return None
    ref = init.find("ref")
    uri = ((init if ref is None else ref).text or "").strip()
    if not uri:
        lib.find.error("An image must name its file; images within the XML are not read.", image)
        return None
    path = lib.file(uri, image, "The image")
    if path is not None and not path.is_file():
        lib.find.error(f'The image "{uri}" is not there.', image)
        return None
    return path
