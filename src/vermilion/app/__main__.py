"""`python -m vermilion.app` is the command `vermilion`."""

import sys

from vermilion.app.main import main

if __name__ == "__main__":
    sys.exit(main())
