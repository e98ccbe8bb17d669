"""Words above coordinates and names in the languages that surveyors write: one list for all.

Case, blanks, punctuation and units do not matter (`photocore.tables.heading_words.bare`).
"""

from __future__ import annotations

EAST = ("E", "east", "easting", "Est", "Ost", "Ostwert", "Rechtswert", "Rechts", "abscisse",
        "Este", "geo_x")  # fmt: skip
NORTH = ("N", "north", "northing", "Nord", "Nordwert", "Hochwert", "ordonnée", "Norte",
         "geo_y")  # fmt: skip
HEIGHT = ("H", "height", "elevation", "elev", "altitude", "alt", "Höhe", "Hoehe", "Kote", "quota",
          "altezza", "altitudine", "hauteur", "cote", "cota", "altura", "RL", "reduced level",
          "NHN", "orthometric height", "ortho height", "ortho hgt", "quota ortometrica", "hgt",
          "el", "geo_z", "hoogte", "výška", "wysokość", "rzędna", "magasság", "höjd", "højde",
          "høyde", "korkeus", "visina", "kota", "altitud", "înălțime")  # fmt: skip
NAMES = ("point", "name", "punto", "punkt", "nr", "no", "number", "label", "marker", "gcp", "pt",
         "pnt", "point id", "point no", "point number", "Punktnummer", "Punkt-Nr", "Pkt", "nome",
         "nome punto", "numero punto", "matricule", "nom", "no de point", "GCP name", "GCP label",
         "Bezeichnung", "číslo bodu", "bod", "nr punktu", "punt", "ponto", "pont", "pontszám",
         "piste", "točka")  # fmt: skip
#: Of the photo in which a row's pixel lies.
PHOTOS = (
    "image",
    "camera",
    "foto",
    "bild",
    "immagine",
    "filename",
    "file",
    "picture",
    "image name",
)
#: Of the pixel.
COLUMNS_OF_PIXELS = ("column", "colonna", "spalte", "px", "pixel x", "im_x", "u")
ROWS_OF_PIXELS = ("line", "riga", "zeile", "py", "pixel y", "im_y", "v")
