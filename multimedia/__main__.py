"""The command line: ``multimedia``, or ``python -m multimedia``."""

from photocore.interrupts import end_on_signals


def main() -> None:
    """Run it, ready for Ctrl-C before the imports that take their time."""
    end_on_signals()
    from multimedia.cli.main import main as program

    program(prog_name="multimedia")


if __name__ == "__main__":
    main()
