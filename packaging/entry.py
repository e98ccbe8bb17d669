"""The one program of a standalone folder: `bifocal` or `multimedia`, as it is called."""

import multiprocessing
import sys
from pathlib import Path

if __name__ == "__main__":
    multiprocessing.freeze_support()
    if Path(sys.argv[0]).stem == "multimedia":
        from multimedia.__main__ import main
    else:
        from bifocal.__main__ import main
    main()
