"""Words above coordinates and names, in English, Italian, German and French: one list for all.

Case, blanks, punctuation and units do not matter (`photocore.tables.heading_words.bare`).
"""

from __future__ import annotations

EAST = ("E", "east", "easting", "Est", "Ost", "Ostwert", "Rechtswert", "Rechts", "coordinata E",
        "coord E", "abscisse")  # fmt: skip
NORTH = ("N", "north", "northing", "Nord", "Nordwert", "Hochwert", "coordinata N", "coord N",
         "ordonnée")  # fmt: skip
HEIGHT = ("H", "height", "elevation", "elev", "altitude", "alt", "Höhe", "Hoehe", "Kote", "quota",
          "altezza", "altitudine", "hauteur", "cote", "cota", "altura", "RL", "reduced level",
          "NHN", "orthometric height", "quota ortometrica")  # fmt: skip
NAMES = ("point", "name", "punto", "punkt", "nr", "no", "number", "label", "marker", "gcp", "pt",
         "pnt", "point id", "point no", "point number", "Punktnummer", "Punkt-Nr", "Pkt", "nome",
         "nome punto", "numero punto", "matricule", "nom", "no de point", "GCP name",
         "Bezeichnung")  # fmt: skip
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
