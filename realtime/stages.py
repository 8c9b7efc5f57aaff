"""What a renderer keeps on the GPU between images."""

from dataclasses import dataclass
from typing import Self

import moderngl

from realtime.bodies import Bodies
from realtime.gbuffer import GBufferStage
from realtime.lighting import LightingStage
from realtime.materials import MaterialTable
from realtime.merge import MergeStage
from realtime.programs import Programs
from realtime.shadow_maps import ShadowMaps
from realtime.target import Targets
from realtime.uploads import Uploads


@dataclass(frozen=True, eq=False)
class Stages:
    uploads: Uploads
    programs: Programs
    table: MaterialTable
    bodies: Bodies
    shadows: ShadowMaps
    gbuffer: GBufferStage
    merge: MergeStage
    lighting: LightingStage
    targets: Targets

    @classmethod
    def create(cls, context: moderngl.Context) -> Self:
        uploads, programs = Uploads(context), Programs(context)
        table = MaterialTable(context, uploads)
        bodies = Bodies(context, uploads, table)
        return cls(
            uploads,
            programs,
            table,
            bodies,
            ShadowMaps(context, uploads, programs, bodies),
            GBufferStage(context, uploads, programs, bodies),
            MergeStage(context, programs, bodies),
            LightingStage(context, uploads, programs, bodies),
            Targets(context),
        )

    def release(self) -> None:
        for part in (
            self.shadows,
            self.gbuffer,
            self.merge,
            self.lighting,
            self.targets,
            self.bodies,
            self.table,
            self.programs,
            self.uploads,
        ):
            part.release()
