"""A single cause is all where it gains what was hoped for from home."""

from types import SimpleNamespace
from typing import Any

import pytest

from analysis.gap.search.fit import _followed

CAMERA, WORKPIECE = ("camera_pose", "Camera0"), ("object_pose", "block")


def _stand(cause: tuple[str, str], gain: float) -> Any:
    h = [SimpleNamespace(score=gain, causes=(cause,)), SimpleNamespace(score=0.0, causes=())]
    return SimpleNamespace(best=h[0], hypotheses=h, is_its_own=True)


@pytest.mark.parametrize(("gain", "best"), [(80.0, CAMERA), (30.0, WORKPIECE)])
def test_one_that_gains_less_than_half_is_not_all(gain: float, best: tuple[str, str]) -> None:
    """A tilted workpiece moves an image about as a camera does, from afar: followed to where that stands it gained 56
    of 126, and the workpiece 1046 more."""
    first = _stand(CAMERA, 100.0)
    ends = {CAMERA: _stand(CAMERA, gain), WORKPIECE: _stand(WORKPIECE, 300.0)}
    starts = {c: SimpleNamespace(hypothesis=SimpleNamespace(causes=(c,), score=100.0)) for c in ends}
    search: Any = SimpleNamespace(
        alone=lambda first: starts[CAMERA],
        may_move=lambda best: False,
        starts=lambda first: [starts[WORKPIECE]],
        followed=lambda first, start, *rest, passed: ends[start.hypothesis.causes[0]],
    )
    stands = _followed(search, first, False)
    assert max(stands, key=lambda s: s.best.score).best.causes == (best,)


def test_a_start_that_another_came_by_is_not_followed_again() -> None:
    followed = []

    def follow(first: Any, start: Any, *rest: Any, passed: dict[Any, Any]) -> Any:
        followed.append(start.hypothesis.causes)
        passed |= {frozenset({WORKPIECE}): [], frozenset({CAMERA}): []}
        return _stand(WORKPIECE, 300.0)

    starts = [
        SimpleNamespace(hypothesis=SimpleNamespace(causes=(c,), score=100.0)) for c in (WORKPIECE, CAMERA)
    ]
    search: Any = SimpleNamespace(
        alone=lambda first: None, may_move=lambda best: False, starts=lambda first: starts, followed=follow
    )
    assert len(_followed(search, _stand(CAMERA, 100.0), False)) == 1
    assert followed == [(WORKPIECE,)]


def test_what_stays_behind_by_itself_does_not_keep_a_move_of_the_same_from_being_followed() -> None:
    """From home the camera ends in a place that is not it, and from where an approach came to it, it is all."""
    first = _stand(CAMERA, 100.0)
    start, move = (
        SimpleNamespace(hypothesis=SimpleNamespace(causes=(CAMERA,), score=100.0)) for _ in range(2)
    )
    ends = {id(start): _stand(CAMERA, 30.0), id(move): _stand(CAMERA, 400.0)}
    search: Any = SimpleNamespace(
        alone=lambda first: start,
        may_move=lambda best: True,
        moves=lambda first: [move],
        starts=lambda first: [start],
        beside=lambda first, start, stand: None,
        gone_on=lambda stand, *rest: stand,
        followed=lambda first, start, *rest, passed=None: ends[id(start)],
    )
    assert max(s.best.score for s in _followed(search, first, False)) == 400
