"""Run the command line as ``python -m bifocal``."""

from bifocal.cli.main import main

if __name__ == "__main__":
    main()
