"""The solver of a point survey: measured points to relief, coordinates, precision, world.

Read `observations`, `setup`, `survey_lens`, `survey_media` and `survey_input` for what goes in,
`relief_table`, `reference` and `solved_survey` for what comes out; `solver` leads from one to the
other. `arranging` exchanges or converts what was typed in other units (`units`) and corrects the
orientation by points of the plane (`orientation_check`); `point_survey` is where Eqs. (1) to (7)
run, its columns prepared by `radii`, `refracted_radii` and `image_shift`. More than two photos are
`other_photos` and `set_survey`. Then the world: `georeferencing`, by `weighted_similarity`, its
worth by `transformation_precision`. Last the judgement: `check_points`, `taped`, `tolerances`,
`wall_precision`, `basis`, `remarks`; `results` are its words.
"""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
