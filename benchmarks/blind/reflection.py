"""Reflectance models as Mitsuba plugins, written from their papers: Lafortune 1997, UsdPreviewSurface 2.6."""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np


class Model(mi.BSDF):
    """One-sided; sampled half by the cosine, half by ``towards``."""

    def __init__(self, props: mi.Properties) -> None:
        mi.BSDF.__init__(self, props)
        flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide
        self.m_components = [flags]
        self.m_flags = flags

    def f(self, si: Any, wo: Any) -> Any:
        raise NotImplementedError

    def towards(self, wi: Any, sample: Any) -> Any:
        raise NotImplementedError

    def density(self, wi: Any, wo: Any) -> Any:
        raise NotImplementedError

    def _pdf(self, wi: Any, wo: Any) -> Any:
        return 0.5 * mi.warp.square_to_cosine_hemisphere_pdf(wo) + 0.5 * self.density(wi, wo)

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any) -> Any:
        active &= mi.Frame3f.cos_theta(si.wi) > 0
        wo = dr.select(
            sample1 < 0.5, mi.warp.square_to_cosine_hemisphere(sample2), self.towards(si.wi, sample2)
        )
        active &= mi.Frame3f.cos_theta(wo) > 0
        found = mi.BSDFSample3f()
        found.wo = wo
        found.pdf = self._pdf(si.wi, wo)
        found.eta = 1.0
        found.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        found.sampled_component = mi.UInt32(0)
        active &= found.pdf > 0
        value = self.f(si, wo) * mi.Frame3f.cos_theta(wo) / found.pdf
        return found, dr.select(active, mi.Color3f(value), 0)

    def _above(self, si: Any, wo: Any, active: Any) -> Any:
        return active & (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(wo) > 0)

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
        value = mi.Color3f(self.f(si, wo) * mi.Frame3f.cos_theta(wo))
        return dr.select(self._above(si, wo, active), value, 0)

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
        return dr.select(self._above(si, wo, active), self._pdf(si.wi, wo), 0)

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def traverse(self, callback: Any) -> None:
        pass

    def to_string(self) -> str:
        return type(self).__name__


def _color(props: mi.Properties, name: str) -> Any:
    value = mi.Color3f(*(float(props[f"{name}{c}"]) for c in "rgb"))
    dr.make_opaque(value)
    return value


def _number(props: mi.Properties, name: str) -> Any:
    value = mi.Float(float(props[name]))
    dr.make_opaque(value)
    return value


class Lafortune(Model):
    """One lobe: f = rho / pi + w max(C . (wi * wo), 0)^n."""

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.rho, self.w, self.C, self.n = (
            _color(props, "rho"),
            _color(props, "w"),
            _color(props, "C"),
            _number(props, "n"),
        )

    def _axis(self, wi: Any) -> Any:
        return mi.Vector3f(self.C.x * wi.x, self.C.y * wi.y, self.C.z * wi.z)

    def f(self, si: Any, wo: Any) -> Any:
        return self.rho / dr.pi + self.w * dr.power(dr.maximum(dr.dot(self._axis(si.wi), wo), 0), self.n)

    def towards(self, wi: Any, sample: Any) -> Any:
        cos = dr.power(sample.x, 1 / (self.n + 1))
        sin, phi = dr.safe_sqrt(1 - cos * cos), 2 * dr.pi * sample.y
        local = mi.Vector3f(sin * dr.cos(phi), sin * dr.sin(phi), cos)
        return mi.Frame3f(dr.normalize(self._axis(wi))).to_world(local)

    def density(self, wi: Any, wo: Any) -> Any:
        cos = dr.maximum(dr.dot(dr.normalize(self._axis(wi)), wo), 0)
        return (self.n + 1) / (2 * dr.pi) * dr.power(cos, self.n)


class Preview(Model):
    """UsdPreviewSurface, metallic workflow with metallic 0, no clear coat, ior 1.5."""

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.rho, self.roughness = _color(props, "rho"), _number(props, "roughness")

    def _d(self, cos_h: Any) -> Any:
        a2 = dr.square(dr.square(self.roughness))
        return a2 / (dr.pi * dr.square(dr.square(cos_h) * (a2 - 1) + 1))

    def f(self, si: Any, wo: Any) -> Any:
        wi = si.wi
        h = dr.normalize(wi + wo)
        k = dr.square(self.roughness) / 2
        g = 1 / ((wi.z * (1 - k) + k) * (wo.z * (1 - k) + k))
        fresnel = 0.04 + 0.96 * dr.power(dr.maximum(1 - dr.dot(wo, h), 0), 5)
        return self.rho / dr.pi * (1 - fresnel) + fresnel * self._d(h.z) * g / 4

    def towards(self, wi: Any, sample: Any) -> Any:
        a2 = dr.square(dr.square(self.roughness))
        cos = dr.safe_sqrt((1 - sample.x) / (1 + (a2 - 1) * sample.x))
        sin, phi = dr.safe_sqrt(1 - cos * cos), 2 * dr.pi * sample.y
        h = mi.Vector3f(sin * dr.cos(phi), sin * dr.sin(phi), cos)
        return 2 * dr.dot(wi, h) * h - wi

    def density(self, wi: Any, wo: Any) -> Any:
        h = dr.normalize(wi + wo)
        return dr.select(dr.dot(wi, h) > 0, self._d(h.z) * h.z / (4 * dr.maximum(dr.dot(wi, h), 1e-6)), 0)


def register() -> None:
    mi.register_bsdf("blind_lafortune", Lafortune)
    mi.register_bsdf("blind_preview", Preview)


def rgb(name: str, value: Any) -> dict[str, float]:
    return {f"{name}{c}": float(x) for c, x in zip("rgb", np.ravel(value), strict=True)}
