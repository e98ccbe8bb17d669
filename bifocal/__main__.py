"""The command line: ``bifocal``, or ``python -m bifocal``."""

from photocore.interrupts import end_on_signals


def main() -> None:
    """Run it, ready for Ctrl-C before the imports that take their time."""
    end_on_signals()
    from bifocal.cli.main import main as program

    program(prog_name="bifocal")


if __name__ == "__main__":
    main()
