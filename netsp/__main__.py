"""`python -m netsp`."""

import sys

from netsp.command.main import main

sys.exit(main())
