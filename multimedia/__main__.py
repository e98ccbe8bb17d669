"""Run the command line as ``python -m multimedia``."""

from multimedia.cli.main import main

if __name__ == "__main__":
    main()
