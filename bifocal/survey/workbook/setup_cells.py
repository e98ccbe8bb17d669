"""The sheet `Setup` as data: its cells in order, their formats, their formulas."""

from __future__ import annotations

from collections.abc import Mapping

from bifocal.model.flags import SIGMA_PIXEL, UNCERTAIN_SHARE
from bifocal.survey.setup import SIGMA_RADIAL

Groups = tuple[tuple[str, ...], ...]

#: Cells that name the photo files.
PHOTOS = ("photo_1", "photo_2")
#: Cells of an ideal pair, group by group; the last group is calculated, the others are typed.
IDEAL_GROUPS: Groups = (
    (
        *("c_1", "c_2", "d_2", "delta_d", "d_1", "input_unit", "pitch"),
        *("nadir_1_col", "nadir_1_row", "nadir_2_col", "nadir_2_row"),
        *PHOTOS,
    ),
    ("sigma_s", "sigma_r_max", "k_off", "k_plane"),
    (
        *("m_1", "m_2", "k_12", "b_lever", "unit_x", "unit_y"),
        *("off_x1", "off_y1", "off_x2", "off_y2"),
    ),
)
MATRICES: Groups = tuple(
    tuple(f"h{image}_{row}{column}" for row in "123" for column in "123") for image in "12"
)
NADIRS: Groups = tuple(tuple(f"n{image}_{axis}" for axis in "xy") for image in "12")
#: The same of a pair given by homographies.
PAIR_GROUPS: Groups = (
    (
        *("pair_file", "d_2", "delta_d", "d_1", *NADIRS[0], *NADIRS[1]),
        *("c_1", "c_2", "pitch", "input_unit", *PHOTOS),
    ),
    ("sigma_px", "sigma_r_max", "k_off", "k_plane", "pixel_wall"),
    *MATRICES,
    ("m_1", "b_lever", "e_x", "e_y", "sigma_s"),
)
#: Number formats.
FORMS: Mapping[str, str] = {
    **dict.fromkeys(("d_1", "d_2", "delta_d", "b_lever"), "0.000"),
    **dict.fromkeys(("pitch", "sigma_s", "k_12"), "0.000000"),
    **dict.fromkeys(("m_1", "m_2"), "0.00"),
    "sigma_r_max": "0.0000",
    **dict.fromkeys(PHOTOS, "@"),
}
#: Typed numbers that must be above zero; of the others the sheet only asks that they are numbers.
POSITIVE = ("c_1", "c_2", "d_1", "d_2", "pitch", "sigma_s", "sigma_px", "sigma_r_max")
#: Cells that are yellow and hold a formula until something is typed over it.
TYPED_FORMULAS: Mapping[str, str] = {
    "d_1": 'IF(COUNT(d_2,delta_d)=2,d_2+delta_d,"")',
    "sigma_s": f"IF(COUNT(pitch)=1,{SIGMA_PIXEL:g}*pitch,{SIGMA_RADIAL:g})",
    "sigma_r_max": f'IF(COUNT(d_1,d_2)=2,{UNCERTAIN_SHARE:g}*MIN(d_1,d_2),"")',
}
IDEAL_FORMULAS: Mapping[str, str] = {
    **TYPED_FORMULAS,
    "m_1": 'IF(COUNT(c_1,d_1)=2,1000*d_1/c_1,"")',
    "m_2": 'IF(COUNT(c_2,d_2)=2,1000*d_2/c_2,"")',
    "k_12": "IF(COUNT(m_1,m_2)=2,m_2/m_1,1)",
    "b_lever": 'IF(COUNT(d_1,d_2)=2,IF(d_1=d_2,"",d_1*d_2/(d_1-d_2)),"")',
    "unit_x": 'IF(input_unit="px",pitch,1)',
    "unit_y": 'IF(input_unit="px",-pitch,1)',
    "off_x1": 'IF(input_unit="px",nadir_1_col,0)',
    "off_y1": 'IF(input_unit="px",nadir_1_row,0)',
    "off_x2": 'IF(input_unit="px",nadir_2_col,0)',
    "off_y2": 'IF(input_unit="px",nadir_2_row,0)',
}
PAIR_FORMULAS: Mapping[str, str] = {
    **{key: IDEAL_FORMULAS[key] for key in ("d_1", "sigma_r_max", "b_lever")},
    "sigma_s": 'IF(COUNT(pixel_wall)=1,sigma_px*pixel_wall/m_1,"")',
    "m_1": "IF(COUNT(c_1)=1,1000*d_1/c_1,1000)",
    "e_x": "(d_1*n2_x-d_2*n1_x)/(d_1-d_2)",
    "e_y": "(d_1*n2_y-d_2*n1_y)/(d_1-d_2)",
}
