"""Lists of points as instruments and programs write them, and the headings people write."""

from __future__ import annotations

import json

import ezdxf
import numpy as np
import pytest

from photocore.errors import InputError, PhotogrammetryError, WorkbookError
from photocore.tables import Column, open_tables, parse_column_map, read_table
from photocore.tables.axes import EAST, HEIGHT, NAMES, NORTH, PHOTOS
from photocore.tables.encodings import decoded
from photocore.textfile import read_text

COLUMNS = (
    Column("id", NAMES, kind="text"),
    Column("E", ("X", *EAST), unit="m"),
    Column("N", ("Y", *NORTH), unit="m"),
    Column("H", ("Z", *HEIGHT), unit="m"),
    Column("photo", PHOTOS, kind="text"),
    Column("col", unit="px"),
    Column("row", unit="px"),
    Column("use", kind="flag"),
)


def read(folder, name, text, **options):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_table(path, COLUMNS, **options)


def rows(table, *keys):
    return [
        tuple(values) for values in zip(*(list(table.values[key]) for key in keys), strict=True)
    ]


def test_gsi_8_and_16_of_a_leica_instrument_give_metres(tmp_path):
    eight = "110001+0000A110 81..10+00652345 82..10+06862123 83..10+00250125\n"
    table = read(tmp_path, "a.gsi", eight)
    assert rows(table, "id", "E", "N", "H") == [("A110", 652.345, 6862.123, 250.125)]
    sixteen = (
        "*110002+0000000000000P07 81..16+0000006523451234 82..16+0000068621231234"
        " 83..16-0000000000001250\n"
    )
    table = read(tmp_path, "b.gsi", sixteen)
    assert rows(table, "id", "E", "N", "H") == [("P07", 652345.1234, 6862123.1234, -0.125)]
    assert any("Leica (GSI)" in text for text in table.remarks)


def test_gsi_with_angles_alone_is_refused_and_feet_are_converted(tmp_path):
    with pytest.raises(InputError, match="no coordinates"):
        read(tmp_path, "a.gsi", "110001+00000001 21.102+17920860 22.102+07567500 31..00+00011040\n")
    feet = "110001+00000001 81..11+00010000 82..11+00020000 83..11+00001000\n"
    table = read(tmp_path, "b.gsi", feet)
    assert rows(table, "E", "N", "H") == [(pytest.approx(3.048), 6.096, 0.3048)]


def test_gcp_list_of_opendronemap_has_a_row_a_photo_and_names_points_of_one_place(tmp_path):
    text = (
        "EPSG:32632\n544256.7 5320919.9 5.5 3044.25 2622.5 IMG_0525.jpg gcp01\n# off\n"
        "544157.7 5320899.2 NaN 100 200 IMG_0585.jpg\n544157.7 5320899.2 NaN 300 400 IMG_1.jpg\n"
    )
    table = read(tmp_path, "gcp_list.txt", text)
    assert table.texts("id") == ["gcp01", "gcp 2", "gcp 2"]
    assert rows(table, "photo", "col", "row")[0] == ("IMG_0525.jpg", 3044.25, 2622.5)
    assert table.numbers("H")[0] == 5.5
    assert np.isnan(table.numbers("H")[1:]).all()
    with pytest.raises(InputError, match="degrees of longitude"):
        read(tmp_path, "b.txt", text.replace("EPSG:32632", "EPSG:4326"))


def test_points_of_qgis_count_from_the_corner_with_rows_down_negative(tmp_path):
    text = (
        "#CRS: LOCAL\nmapX,mapY,sourceX,sourceY,enable,dX,dY,residual\n"
        "1.25000,2.50000,100.500,-200.500,1,0,0,0\n3,4,10,-20,0,0,0,0\n"
    )
    table = read(tmp_path, "far.points", text)
    assert rows(table, "E", "N", "col", "row", "use") == [
        (1.25, 2.5, 100.0, 200.0, 1.0), (3.0, 4.0, 9.5, 19.5, 0.0)]  # fmt: skip
    with pytest.raises(InputError, match="a place on the map already"):
        read(tmp_path, "b.points", text.replace("-200.500", "200.500"))


MARKERS = """<?xml version="1.0" encoding="UTF-8"?>
<document version="2.0.0"><chunk label="Chunk 1" enabled="true">
<cameras><camera id="0" label="far.JPG"/><group><camera id="3" label="near.JPG"/></group></cameras>
<markers><marker id="7" label="point 1">
<reference x="10.5" y="20.5" z="3.25" enabled="true"/></marker>
<marker id="8" label="point 2">
<reference x="11.5" y="21.5" z="4.25" enabled="false"/></marker></markers>
<frames><frame id="0"><markers><marker marker_id="7">
<location camera_id="0" pinned="true" x="100.5" y="50.5"/><location camera_id="3" x="20.5" y="10"/>
</marker></markers></frame></frames><reference>LOCAL_CS["Local (m)"]</reference></chunk></document>
"""


def test_markers_of_metashape_have_a_row_a_photo_and_count_from_the_corner(tmp_path):
    table = read(tmp_path, "markers.xml", MARKERS)
    assert rows(table, "id", "E", "photo", "col", "row")[:2] == [
        ("point 1", 10.5, "far.JPG", 100.0, 50.0),
        ("point 1", 10.5, "near.JPG", 20.0, 9.5)]  # fmt: skip
    assert table.numbers("use").tolist() == [1, 1, 0]
    with pytest.raises(InputError, match="degrees of longitude"):
        read(tmp_path, "b.xml", MARKERS.replace("LOCAL_CS", "GEOGCS"))
    twice = MARKERS.replace("</document>", MARKERS.partition('2.0.0">')[2])
    with pytest.raises(InputError, match="several chunks"):
        read(tmp_path, "c.xml", twice)


def test_reference_of_metashape_is_read_below_its_comment_marks(tmp_path):
    text = (
        '# CoordinateSystem: LOCAL_CS["Local Coordinates (m)"]\n'
        "#Label,X/Easting,Y/Northing,Z/Altitude,Error_(m)\nP1,1.5,2.5,3.5,0.01\n# end of file\n"
    )
    table = read(tmp_path, "reference.txt", text)
    assert rows(table, "id", "E", "N", "H") == [("P1", 1.5, 2.5, 3.5)]
    cameras = (
        "# Cameras (1)\n# PhotoID, X, Y, Z, Omega, Phi, Kappa\nIMG_1\t1.5\t2.5\t3.5\t0\t0\t0\n"
    )
    table = read(tmp_path, "cameras.txt", cameras)
    assert rows(table, "E", "N", "H") == [(1.5, 2.5, 3.5)]


def test_realitycapture_and_pix4d_lists_are_read_by_their_headings(tmp_path):
    table = read(tmp_path, "rc.csv", "#name,x,y,alt,heading,pitch,roll\nIMG_1.JPG,1,2,3,0,0,0\n")
    assert rows(table, "id", "E", "N", "H") == [("IMG_1.JPG", 1.0, 2.0, 3.0)]
    table = read(tmp_path, "pix4d.txt", "imagename X Y Z Omega Phi Kappa\nIMG_1.JPG 1 2 3 0 0 0\n")
    assert rows(table, "E", "N", "H") == [(1.0, 2.0, 3.0)]


def shots(**about):
    point = {"type": "Point", "coordinates": [9.1, 48.5, 300.0]}
    feature = {"type": "Feature", "geometry": point, "properties": {"filename": "a.JPG", **about}}
    return json.dumps({"type": "FeatureCollection", "features": [feature]})


def test_shots_of_webodm_are_in_metres_and_degrees_are_refused(tmp_path):
    table = read(tmp_path, "shots.geojson", shots(translation=[544256.7, 5320919.9, 305.5]))
    assert rows(table, "id", "E", "N", "H") == [("a.JPG", 544256.7, 5320919.9, 305.5)]
    with pytest.raises(InputError, match="degrees of longitude"):
        read(tmp_path, "b.geojson", shots())


def test_points_of_a_drawing_take_the_nearest_text_for_their_name(tmp_path):
    drawing = ezdxf.new()
    for k, name in enumerate("AB"):
        drawing.modelspace().add_point((k, 2.0 * k, 3.0))
        drawing.modelspace().add_text(name).set_placement((k + 0.02, 2.0 * k))
    drawing.saveas(tmp_path / "points.dxf")
    table = read_table(tmp_path / "points.dxf", COLUMNS)
    assert rows(table, "id", "E", "N", "H") == [("A", 0.0, 0.0, 3.0), ("B", 1.0, 2.0, 3.0)]


@pytest.mark.parametrize(
    ("headings", "metres"),
    [
        ("Punkt,Rechtswert,Hochwert,Höhe", 1.0),
        ("Nome,Est,Nord,Quota", 1.0),
        ("Matricule,Est,Nord,Altitude", 1.0),
        ("Point ID,Easting [ft],Northing [ft],Elev [ft]", 0.3048),
        ("Pt,E (US survey feet),N (ftUS),H (us-ft)", 1200 / 3937),
        ("Label,X_ft,Y_ft,Z_ft", 0.3048),
    ],
)
def test_axes_are_understood_in_four_languages_and_in_feet(tmp_path, headings, metres):
    table = read(tmp_path, "a.csv", f"{headings}\nP1,10,20,30\n")
    assert rows(table, "id", "E", "N", "H") == [
        ("P1", *(pytest.approx(metres * value, abs=1e-12) for value in (10, 20, 30)))]  # fmt: skip


def test_us_survey_feet_are_2_ppm_longer_and_a_row_of_units_says_so_too(tmp_path):
    table = read(tmp_path, "a.csv", "id,E,N,H\n,ftUS,ftUS,ftUS\nP1,3937,7874,39.37\n")
    assert rows(table, "E", "N", "H") == [(1200.0, 2400.0, pytest.approx(12.0))]
    assert any("US survey feet" in text for text in table.remarks)
    with pytest.raises(InputError, match="stand side by side"):
        read(tmp_path, "b.csv", "id,E [ft],N [ftUS]\nP1,1,2\n")
    with pytest.raises(WorkbookError, match="ft"):
        read(tmp_path, "c.csv", "id,E,col [ft]\nP1,1,2\n")


def test_minus_9999_is_blank_and_counted(tmp_path):
    table = read(tmp_path, "a.csv", "id,E,N,H\nP1,1,2,-9999\nP2,1,2,5\n")
    assert np.isnan(table.numbers("H")[0])
    assert any("H: 1 cells hold -9999" in text for text in table.remarks)


def test_a_list_without_headings_is_asked_for_its_order(tmp_path):
    text = "1,6862123.5,652345.25,250.125,corner\n2,6862124.5,652346.25,251.125,sill\n"
    with pytest.raises(InputError, match="PNEZD"):
        read_table(open_tables_of(tmp_path, text), [*COLUMNS[:1], required("E")])
    places = parse_column_map("PNEZD", [column.key for column in COLUMNS])
    table = read(tmp_path, "a.txt", text, column_map=places)
    assert rows(table, "id", "E", "N", "H")[0] == ("1", 652345.25, 6862123.5, 250.125)


def required(key):
    return Column(key, EAST, required=True)


def open_tables_of(folder, text):
    (folder / "list.csv").write_text(text)
    return open_tables(folder / "list.csv")


def test_a_heading_that_is_nearly_right_is_named_with_the_right_one(tmp_path):
    path = open_tables_of(tmp_path, "id,Eastng,N\nP1,1,2\n")
    with pytest.raises(InputError, match='"Eastng" is not understood; near it is "easting"'):
        read_table(path, [*COLUMNS[:1], required("E")])


@pytest.mark.parametrize(
    ("text", "encoding", "name"),
    [
        ("Fenêtre à gauche, côté", "mac_roman", "Mac Roman"),
        ("Fassade Süd, Größe 5°", "mac_roman", "Mac Roman"),
        ("příční řada, okno č. 1", "cp1250", "Windows-1250"),
        ("Żółta ściana", "cp1250", "Windows-1250"),
        ("Vítězná, ř š ž", "cp1250", "Windows-1250"),
        ("Šedá, Čáslav, Žižkov, věž", "cp1250", "Windows-1250"),
        ("źródło, Świętokrzyska, błąd", "cp1250", "Windows-1250"),
        ("Győr, tűzfal, Üllői út, lépcső", "cp1250", "Windows-1250"),
        ("Vítězná, Žlutá zeď, Šedá", "iso8859-2", "ISO 8859-2"),
        ("Główna, Łódź, ściana", "iso8859-2", "ISO 8859-2"),
        ("Città, perché, lunedì", "mac_roman", "Mac Roman"),
        ("Élévation, cigüeña", "mac_roman", "Mac Roman"),
        ("CITTÀ, dell’arco, 20 m²", "cp1252", "Windows-1252"),
        ("œil-de-bœuf, tête, n° 5", "cp1252", "Windows-1252"),
        ("窓の角1,2", "shift_jis", "Shift-JIS"),
        ("ﾏﾄﾞ, 測点１", "shift_jis", "Shift-JIS"),
        ("Größe, Öl, perché no", "cp1252", "Windows-1252"),
        ("punto più a destra", "utf-16-le", "UTF-16-LE"),
        ("punto più a destra", "utf-16-be", "UTF-16-BE"),
    ],
)
def test_letters_are_read_by_what_they_spell_and_the_encoding_is_said(text, encoding, name):
    content, remarks = decoded(text.encode(encoding))
    assert content == text
    assert [name in remark for remark in remarks] == [True]


def test_letters_of_two_possible_code_pages_are_said_to_be_so():
    content, remarks = decoded("bod č. 7".encode("cp1250"))
    assert content == "bod è. 7"
    assert "read as Windows-1252, but may be Windows-1250" in remarks[0]
    assert "but may be" not in decoded("Größe außen, Tür".encode("cp1252"))[1][0]


@pytest.mark.parametrize(
    "headings",
    ["Matricule;X_L93;Y_L93;Z_NGF", "Punkt;E LV95;N LV95;H LN02",
     "Nome;Coord. Est;Coord. Nord;Quota",
     "Point Number;Grid Easting;Grid Northing;Point Elevation", "Punto;Este;Norte;Cota",
     "Point Id;Easting;Northing;Ortho. Hgt.", "Pt;X coord.;Y coord.;El.",
     "Pt;Easting (U.S. Survey Feet);Northing (us-ft);Elevation (foot_us)",
     "Pt;geo_x;geo_y;geo_z"],
)  # fmt: skip
def test_headings_of_instruments_and_countries_are_understood(tmp_path, headings):
    scale = 3937 / 1200 if "foot" in headings else 1
    row = ";".join(["P1", *(repr(scale * v) for v in (1200.0, 2400.0, 12.0))])
    table = read_table(open_tables_of(tmp_path, f"{headings}\n{row}\n"), COLUMNS)
    assert table.texts("id") == ["P1"]
    np.testing.assert_allclose([table.numbers(k)[0] for k in "ENH"], [1200, 2400, 12])


def test_the_whole_word_goes_first_and_two_systems_are_asked_about(tmp_path):
    path = open_tables_of(tmp_path, "id,Local Easting,Easting,N,H\nP1,1,2,3,4\n")
    assert read_table(path, COLUMNS).numbers("E").tolist() == [2]
    path = open_tables_of(tmp_path, "id,X_UTM,Y_UTM,X_L93,Y_L93\nP1,1,2,3,4\n")
    with pytest.raises(InputError, match='"X_UTM" stands in B1 and D1'):
        read_table(path, COLUMNS)


FEET = (
    'PROJCS["NAD83 / Illinois West (ftUS)",GEOGCS["NAD83",DATUM["North_American_Datum_1983",'
    'SPHEROID["GRS 1980",6378137,298.257222101]],UNIT["degree",0.0174532925199433]],'
    'PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",36.66],'
    'PARAMETER["central_meridian",-90.16],PARAMETER["scale_factor",0.999941177],'
    'PARAMETER["false_easting",2296583.333],UNIT["US survey foot",0.3048006096012192]]'
)
POINTS = '{"features":[{"geometry":{"type":"Point","coordinates":[3937,7874,39.37]}}],"crs":%s}'
#: Lists of one point at 1200, 2400, 12 m that say nowhere but in their system that they are feet.
IN_FEET = {
    "gcp_list.txt": "+proj=tmerc +lon_0=-90 +units=us-ft\n3937 7874 39.37 1 2 far.jpg P1\n",
    "gcp_codes.txt": "EPSG:3436\n3937 7874 39.37 1 2 far.jpg P1\n",
    "far.points": f"#CRS: {FEET}\nmapX,mapY,sourceX,sourceY,enable\n3937,7874,1,-2,1\n",
    "reference.csv": f"# CoordinateSystem: {FEET}\n#Label,X/Easting,Y/Northing,Z/Altitude\n"
    "P1,3937,7874,39.37\n",
    "angles.txt": f"# CoordinateSystem: {FEET}\n# PhotoID, X, Y, Z, Omega\n"
    "P1\t3937\t7874\t39.37\t1\n",
    "reach.csv": "Name,Easting,Northing,Elevation,CS name\n"
    "P1,3937,7874,39.37,NAD83(2011) / Illinois West (ftUS)\n",
    "points.geojson": POINTS % '{"properties":{"name":"urn:ogc:def:crs:EPSG::3436"}}',
    "markers.xml": f"<chunk><reference>{FEET.replace(chr(34), '&quot;')}</reference>"
    '<marker id="0" label="P1"><reference x="3937" y="7874" z="39.37"/></marker></chunk>',
}


@pytest.mark.parametrize("name", IN_FEET)
def test_the_foot_of_the_system_that_a_list_names_is_taken_and_said(tmp_path, name):
    (tmp_path / name).write_text(IN_FEET[name])
    axes = [("X", EAST), ("Y", NORTH), ("Z", HEIGHT)]
    columns = [Column("id", kind="text"), *(Column(k, more, unit="m") for k, more in axes)]
    table = read_table(tmp_path / name, columns)
    wanted = [1200, 2400, np.nan if name == "far.points" else 12]
    np.testing.assert_allclose([table.numbers(k)[0] for k in "XYZ"], wanted, atol=1e-3)
    assert any("US survey feet" in text for text in table.remarks)


def test_the_unit_that_a_drawing_names_is_said(tmp_path):
    drawing = ezdxf.new()
    drawing.modelspace().add_text("P1", dxfattribs={"insert": (1, 2, 3)})
    for unit, remarks in ((4, ["The drawing says its unit is millimeters"]), (6, [])):
        drawing.units = unit
        drawing.saveas(tmp_path / "points.dxf")
        table = read_table(tmp_path / "points.dxf", COLUMNS)
        assert [text[:40] for text in table.remarks] == remarks


def test_degrees_of_any_system_are_refused_and_a_projected_one_is_not(tmp_path):
    path = tmp_path / "gcp_list.txt"
    path.write_text("EPSG:4258\n8.1 49.2 39.37 1 2 far.jpg P1\n")
    with pytest.raises(InputError, match="in degrees of longitude"):
        read_table(path, [Column("id", kind="text"), Column("X", EAST)])
    modern = 'PROJCRS["x",BASEGEOGCRS["WGS 84",DATUM["y",ELLIPSOID["z",6378137,298.25]]],'
    path = tmp_path / "far.points"
    path.write_text(f"#CRS: {modern}\nmapX,mapY,sourceX,sourceY,enable\n3937,7874,1,-2,1\n")
    assert read_table(path, [Column("X")]).numbers("X").tolist() == [3937]


def test_degrees_minutes_and_seconds_are_degrees(tmp_path):
    columns = [Column("id", kind="text"), Column("theta", unit="deg")]
    path = tmp_path / "angles.csv"
    path.write_text("id,theta\nP1,12°30'36''\nP2,-0° 30' 0''\nP3,7.5\n", encoding="utf-8")
    assert read_table(path, columns).numbers("theta").tolist() == [12.51, -0.5, 7.5]


GRAD = (
    "id,theta [grad]\nP1,50\n",
    "id,theta (g)\nP1,50\n",
    "id,theta\nP1,50 g\n",
    "id,theta [deg]\nP1,50 grad\n",
)


@pytest.mark.parametrize("text", GRAD)
def test_grad_is_asked_for_whether_it_is_degrees_or_gon(tmp_path, text):
    path = tmp_path / "angles.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(WorkbookError, match="Write deg or gon into the heading"):
        read_table(path, [Column("id", kind="text"), Column("theta", unit="deg")])


def test_cells_with_formulas_beside_them_keep_their_feet_and_their_minus_9999(tmp_path):
    (tmp_path / "a.csv").write_text("id,E [ft],N\nP1,10,-9999\n")
    table = read_table(tmp_path / "a.csv", COLUMNS, as_typed=True)
    assert rows(table, "E", "N") == [(10.0, -9999.0)]
    assert table.units == {"E": "ft"}


def test_a_pointer_of_git_lfs_is_called_so(tmp_path):
    path = tmp_path / "reconstruction.json"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
    with pytest.raises(InputError, match="pointer of Git LFS"):
        read_text(path, "project")


LISTS = {
    "a.gsi": "*110001+000000000000A110 81..10+0000000000652345 82..10+0000000006862123\n" * 2,
    "gcp_list.txt": "EPSG:32632\n544256.7 5320919.9 5.5 3044.25 2622.5 IMG_0525.jpg gcp01\n",
    "far.points": "#CRS: LOCAL\nmapX,mapY,sourceX,sourceY,enable\n1.25,2.5,100.5,-200.5,1\n",
    "markers.xml": MARKERS,
    "shots.geojson": shots(translation=[544256.7, 5320919.9, 305.5], X=1, Y=2.5),
}


@pytest.mark.parametrize("name", LISTS)
def test_a_damaged_list_is_read_or_refused_in_words(tmp_path, name):
    chance = np.random.default_rng(11)
    pieces = [
        "",
        "x",
        "-",
        "NaN",
        "1e400",
        '"',
        "[",
        "]",
        "{}",
        "null",
        "true",
        "7",
        "\t",
        "\n",
        "<",
    ]
    for _ in range(150):
        text = LISTS[name]
        for _ in range(chance.integers(1, 4)):
            start = int(chance.integers(len(text)))
            end = start + int(chance.integers(0, 9))
            text = text[:start] + str(chance.choice(pieces)) + text[end:]
        try:
            read(tmp_path, name, text)
        except PhotogrammetryError:
            continue
