"""Tests of netsp."""

import os

os.environ.setdefault("NETSP_BACKGROUND", "0")  # tests start no background process
