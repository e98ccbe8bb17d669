"""What a person knows of a wall's relief: faces, break lines, occluders, and relief that obeys.

`faces` are the shapes, `faces_files` their files; `face_planes` gives each face its plane, and
`faced_surface` is relief that obeys all of them. `suggestions` proposes faces where relief was
not measured. `tuning` keeps the numbers.
"""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
