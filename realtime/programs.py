"""Shader programs: files of realtime/shaders put together with what a scene defines, compiled once a text."""

from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources

import moderngl

from interchange.problems import BrightfieldError

HEADER = "#version 410\n"


@cache
def text(name: str) -> str:
    """A file of realtime/shaders."""
    return resources.files("realtime.shaders").joinpath(name).read_text(encoding="utf-8")


def defines(values: Mapping[str, object]) -> str:
    """``#define`` lines: True defines a name, False and None leave it out."""
    return "".join(
        f"#define {name} {'' if value is True else value}\n"
        for name, value in values.items()
        if value is not None and value is not False
    )


def texture_uniforms(name: str) -> str:
    """The declarations that ``sampled(NAME, NAME_uv, NAME_wrap, st)`` needs."""
    return f"uniform sampler2D {name};\nuniform mat3 {name}_uv;\nuniform ivec2 {name}_wrap;\n"


class Programs:
    """Compiled programs by their text."""

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self._compiled: dict[tuple[str, ...], moderngl.Program] = {}

    def get(
        self,
        vertex: Sequence[str],
        fragment: Sequence[str],
        about: str = "",
        tessellation: Sequence[str] = (),
    ) -> moderngl.Program:
        """The program of these sources; ``tessellation``: of the control and the evaluation shader. BrightfieldError
        with the compiler's words; ``about``: whose text."""
        key = ("\n".join(vertex), "\n".join(fragment), *tessellation)
        if key not in self._compiled:
            stages = [HEADER + source for source in key]
            try:
                self._compiled[key] = self.context.program(
                    vertex_shader=stages[0],
                    fragment_shader=stages[1],
                    tess_control_shader=stages[2] if tessellation else None,
                    tess_evaluation_shader=stages[3] if tessellation else None,
                )
            except moderngl.Error as error:
                message = " ".join(str(error).split())
                raise BrightfieldError(
                    f"The shader {about or 'program'} must compile; got: {message}"
                ) from error
        return self._compiled[key]

    def release(self) -> None:
        for program in self._compiled.values():
            program.release()
        self._compiled.clear()


def put(program: moderngl.Program, **uniforms: object) -> None:
    """Set the uniforms that the compiler left in."""
    for name, value in uniforms.items():
        if name in program:
            program[name].value = value  # type: ignore[union-attr]  # uniforms only, by their names
