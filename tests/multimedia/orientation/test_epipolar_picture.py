"""The picture of epipolar curves: names that hide nothing, small curves shown large."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from multimedia.orientation.epipolar_picture import draw_epipolar


def drawn(monkeypatch, tmp_path, curves, targets=()):
    """Return the axes of a picture of curves over 1280 x 1024 px, depths from -12 to 12."""
    figures: list[Figure] = []
    monkeypatch.setattr(
        "multimedia.orientation.epipolar_picture.write_figure",
        lambda _, figure, **__: figures.append(figure),
    )
    draw_epipolar(
        tmp_path / "curves.png", curves, [f"p{k}" for k in range(len(curves))],
        np.array(targets, dtype=float).reshape(-1, 2), size=(1280, 1024),
        depths=[np.linspace(-12, 12, len(curve)) for curve in curves],
    )  # fmt: skip
    figures[0].draw_without_rendering()
    return figures[0].axes[0]


def names(axes):
    """Return the boxes of the names of depths on the canvas, by their texts."""
    return [
        (text.get_text(), text.get_window_extent())
        for text in axes.texts if text.get_text().startswith("Z ")
    ]  # fmt: skip


def test_names_of_depths_hide_no_other_and_end_points_come_first(monkeypatch, tmp_path):
    """Forty level curves of 60 px in a row, as a calibration body gives them."""
    curves = [
        np.column_stack([np.linspace(x, x + 60, 9), np.full(9, row)])
        for row in (300.0, 450.0, 600.0) for x in np.linspace(200, 1000, 14)
    ]  # fmt: skip
    axes = drawn(monkeypatch, tmp_path, curves)
    assert axes.get_xlim() == (-0.5, 1279.5)
    found = names(axes)
    assert {"Z -10", "Z 10"} <= {text for text, _ in found}
    for k, (_, box) in enumerate(found):
        assert not any(box.overlaps(other) for _, other in found[:k])


def test_a_short_curve_is_enlarged_within_the_image(monkeypatch, tmp_path):
    """In a corner of the image: all of it is seen, with all its depths, in the image's form."""
    curve = np.column_stack([np.linspace(3, 13, 9), np.linspace(1010, 1021, 9)])
    axes = drawn(monkeypatch, tmp_path, [curve], targets=[[8.0, 1015.0]])
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    assert left >= -0.5
    assert bottom <= 1023.5
    assert left < 3 < 13 < right
    assert top < 1010 < 1021 < bottom
    assert right - left < 100
    np.testing.assert_allclose((right - left) / (bottom - top), 1280 / 1024)
    assert [text for text, _ in names(axes)] == ["Z -10", "Z 10", "Z -5", "Z 0", "Z 5"]
