"""What the gap is measured by: shares, edges in px, and the user's own function."""

from collections.abc import Callable
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ndtr

from analysis.gap.measures import metric
from analysis.gap.measures.edges import fit_edges, offsets
from analysis.gap.measures.shapley import shares
from interchange.camera import Camera
from interchange.problems import BrightfieldError


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(11)


def test_shares_are_the_mean_over_all_orders(rng: np.random.Generator) -> None:
    players = ["a", "b", "c", "d"]
    table = {frozenset(p[:n]): float(rng.normal()) for p in permutations(players) for n in range(5)}
    found = shares(players, table.__getitem__)
    orders = list(permutations(players))
    for player in players:
        gains = [
            table[frozenset(o[: o.index(player) + 1])] - table[frozenset(o[: o.index(player)])]
            for o in orders
        ]
        assert found[player] == pytest.approx(np.mean(gains), abs=1e-12)
    assert sum(found.values()) == pytest.approx(table[frozenset(players)] - table[frozenset()], abs=1e-12)


def test_who_adds_nothing_has_no_share() -> None:
    found = shares(["works", "idles"], lambda s: 3.0 * ("works" in s))
    assert found == {"works": 3.0, "idles": 0.0}


@pytest.mark.parametrize("shift", [-1.3, -0.02, 0.0, 0.4])
@pytest.mark.parametrize("width", [0.4, 1.2])
def test_an_edge_is_found_where_it_is(shift: float, width: float) -> None:
    t = np.linspace(-4, 4, 25)
    y = 100 + 3 * t + 500 * ndtr((t - shift) / width)
    found = fit_edges(t, y[None])
    assert found.t0[0] == pytest.approx(shift, abs=1e-5)
    assert found.width[0] == pytest.approx(width, rel=1e-4)
    assert found.step[0] == pytest.approx(500, rel=1e-4)
    assert found.misfit[0] == pytest.approx(0, abs=1e-3)


def test_noise_moves_an_edge_as_its_variance_says(rng: np.random.Generator) -> None:
    t = np.linspace(-4, 4, 25)
    y = 100 + 500 * ndtr((t - 0.2) / 0.8) + 5 * rng.standard_normal((4000, 25))
    found = fit_edges(t, y)
    assert np.std(found.t0) == pytest.approx(
        5 * np.sqrt(np.median(found.variance)), rel=0.1
    )  # 4000 draws: ± 1 %, and the tails


def _disk(x0: float, y0: float) -> np.ndarray:
    """(120, 160, 1): a bright disk of radius 35 px, its rim as soft as a pixel."""
    y, x = np.mgrid[:120, :160]
    return (200 + 800 * ndtr((35 - np.hypot(x - x0, y - y0)) / 0.7))[..., None].astype(np.float32)


def test_a_disk_that_is_shifted_shows_by_how_much(rng: np.random.Generator) -> None:
    """A shift d gives offsets d cos φ round the rim: mean 0, rms d / √2."""
    y, x = np.mgrid[:120, :160]
    region = (np.hypot(x - 80, y - 60) < 35).astype(int)
    ok, noise = np.ones((120, 160), bool), np.full((120, 160), 3.0)
    capture = _disk(80.3, 60) + 3 * rng.standard_normal((120, 160, 1)).astype(np.float32)
    found = offsets([capture], [[_disk(80, 60)], [_disk(80.3, 60)]], [region], [ok], [noise])
    assert found is not None
    moved, same = found
    assert moved.count == same.count > 150
    assert moved.mean == pytest.approx(0, abs=0.01)
    assert moved.rms == pytest.approx(0.3 / np.sqrt(2), rel=0.03)
    assert same.rms == pytest.approx(same.floor, rel=0.3)


def test_a_disk_that_is_larger_shows_by_how_much() -> None:
    y, x = np.mgrid[:120, :160]
    region = (np.hypot(x - 80, y - 60) < 35).astype(int)
    larger = (200 + 800 * ndtr((35.2 - np.hypot(x - 80, y - 60)) / 0.7))[..., None]
    found = offsets(
        [larger], [[_disk(80, 60)]], [region], [np.ones((120, 160), bool)], [np.full((120, 160), 1.0)]
    )
    assert found is not None
    assert found[0].mean == pytest.approx(
        -0.2, abs=0.005
    )  # it reaches further out: away from the bright side


def test_no_contrast_no_edges() -> None:
    flat = np.full((60, 60, 1), 500, np.float32)
    region = np.indices((60, 60))[1] // 30
    ok = np.ones((60, 60), bool)
    assert offsets([flat], [[flat]], [region], [ok], [np.ones((60, 60))]) is None


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], str]:
    """Writes a module of the given text where the command would be called; returns its name."""
    monkeypatch.chdir(tmp_path)

    def write(text: str) -> str:
        name = f"measure_{abs(hash(text))}"
        (tmp_path / f"{name}.py").write_text(text)
        return name

    return write


def test_a_function_of_an_image_is_a_metric(module: Callable[[str], str]) -> None:
    image, camera = np.full((4, 5, 1), 7, np.float32), Camera()
    one = metric.load(module("def brightest(image): return image.max()") + ":brightest")
    assert one(image, camera) == 7.0
    two = metric.load(module("def seen(image, camera): return camera.t_exp * image.mean()") + ":seen")
    assert two(image, camera) == 7.0


@pytest.mark.parametrize(
    ("text", "function", "said"),
    [
        ("def size(image): return 1", "siz", 'no function "siz". Did you mean "size"?'),
        ("import nothing_like_that", "f", "needs nothing_like_that"),
        ("1 / 0", "f", "cannot be imported: ZeroDivisionError: division by zero ("),
        ("def f(a, b, c): return 1", "f", "must take an image, or an image and a camera"),
    ],
)
def test_a_metric_that_cannot_be_had_is_told(
    module: Callable[[str], str], text: str, function: str, said: str
) -> None:
    with pytest.raises(BrightfieldError) as error:
        metric.load(f"{module(text)}:{function}")
    assert said in str(error.value)


@pytest.mark.parametrize("name", ["no_such_module_here:f", "math", ":f", "math:"])
def test_a_metric_needs_a_module_and_a_function(name: str) -> None:
    with pytest.raises(BrightfieldError):
        metric.load(name)


@pytest.mark.parametrize(
    "body", ["return None", "return 'wide'", "return float('nan')", "raise KeyError('x')"]
)
def test_a_metric_must_give_a_number(module: Callable[[str], str], body: str) -> None:
    measure = metric.load(module(f"def f(image): {body}") + ":f")
    with pytest.raises(BrightfieldError, match="metric"):
        measure(np.zeros((2, 2, 1), np.float32), Camera())
