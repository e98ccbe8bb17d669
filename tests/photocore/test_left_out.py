"""A library that is not there is named with what brings it, whichever it is."""

import pytest

from photocore.installation import left_out


@pytest.mark.parametrize(
    ("name", "words"),
    [("openpyxl", "--force-reinstall bifocal-relief"), ("cv2.aruco", "--force-reinstall"),
     ("laspy", '".[cloud]"'), ("bifocal.absent", ""), ("photocore.x", "")],
)  # fmt: skip
def test_what_lacks_is_named_unless_it_is_a_module_of_ours(name, words):
    text = left_out(ModuleNotFoundError("no", name=name))
    assert bool(text) == bool(words)
    assert words in text
    assert not words or name.partition(".")[0] in text
