"""Formulas of the cells of `Setup`: defaults that may be overtyped, and what follows from them."""

from __future__ import annotations

from collections.abc import Mapping

#: Cells that are yellow and hold a formula until something is typed over it.
TYPED_FORMULAS: Mapping[str, str] = {
    "d_1": 'IF(COUNT(d_2,delta_d)=2,d_2+delta_d,"")',
    "sigma_s": "IF(COUNT(pitch)=1,0.5*pitch,0.004)",
    "sigma_r_max": 'IF(COUNT(d_1,d_2)=2,0.02*MIN(d_1,d_2),"")',
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
    "sigma_s": "sigma_px*pixel_mm",
    "m_1": "IF(COUNT(c_1)=1,1000*d_1/c_1,1000)",
    "e_x": "(d_1*n2_x-d_2*n1_x)/(d_1-d_2)",
    "e_y": "(d_1*n2_y-d_2*n1_y)/(d_1-d_2)",
}
