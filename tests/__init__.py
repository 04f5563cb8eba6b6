"""Tests of netsp."""

import os

os.environ.setdefault("NETSP_BACKGROUND", "0")  # commands under test start no other process
