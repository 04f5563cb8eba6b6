"""Settings of all tests: laws have no deadline, because the speed of a test is the machine's."""

from hypothesis import settings

settings.register_profile("netsp", deadline=None)
settings.load_profile("netsp")
