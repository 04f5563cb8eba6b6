"""`python -m netsp`."""

import sys

from netsp.cli import main

sys.exit(main())
