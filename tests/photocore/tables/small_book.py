"""Small workbooks with a table of polar picks."""

from photocore.tables import Column

POLAR = (
    Column("id", ("Point", "Punto", "Punkt", "Nr."), kind="text", required=True),
    Column("s1", ("distanza radiale 1", "Radialdistanz 1"), required=True, unit="mm"),
    Column("s2", ("distanza radiale 2", "Radialdistanz 2"), required=True, unit="mm"),
    Column("theta", ("anomalia", "Richtung"), unit="deg"),
    Column("use", kind="flag"),
)
SAMPLES = [("P1", 12.5, 13.25, 30.0), ("P2", 14.75, 15.5, 200.0)]


def polar_rows(heading=("id", "s1", "s2", "theta"), data=SAMPLES):
    return [heading, *data]


def check_samples(table):
    assert table.texts("id") == ["P1", "P2"]
    assert table.numbers("s1").tolist() == [12.5, 14.75]
    assert table.numbers("s2").tolist() == [13.25, 15.5]
