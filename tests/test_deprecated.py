"""Names that have changed still work, and warn once under which name they are found now."""

import types

import pytest

from netsp.base.deprecated import deprecated_method, deprecated_names, renamed_parameters


class Track:
    def __init__(self):
        self.places = []

    def update(self, place):
        self.places.append(place)
        return len(self.places)

    @property
    def last(self):
        return self.places[-1]

    @classmethod
    def empty(cls):
        return cls()

    take = deprecated_method("take", "update")
    end = deprecated_method("end", "last")
    none = deprecated_method("none", "empty")


def test_a_renamed_function_of_a_module_is_found_with_a_warning():
    module = types.ModuleType("example")
    module.paths = object()
    module.__getattr__ = deprecated_names(vars(module), ways="paths")
    with pytest.warns(DeprecationWarning, match=r"example\.ways is now example\.paths"):
        assert module.ways is module.paths
    with pytest.raises(AttributeError, match="no attribute 'other'"):
        _ = module.other


def test_renamed_methods_properties_and_class_methods_give_what_the_new_ones_give():
    track = Track()
    with pytest.warns(DeprecationWarning, match=r"Track\.take is now Track\.update") as seen:
        assert track.take("a") == 1
    assert seen[0].filename == __file__
    with pytest.warns(DeprecationWarning, match=r"Track\.end is now Track\.last"):
        assert track.end == "a"
    with pytest.warns(DeprecationWarning, match=r"Track\.none"):
        assert Track.none().places == []


def test_an_old_parameter_reaches_the_new_one_and_both_at_once_are_refused():
    @renamed_parameters(told="on_progress")
    def search(goals, on_progress=None):
        return goals, on_progress

    with pytest.warns(DeprecationWarning, match="told of search is now on_progress") as seen:
        assert search(1, told=len) == (1, len)
    assert seen[0].filename == __file__
    assert search(1, on_progress=max) == (1, max)
    with pytest.raises(TypeError, match="both 'on_progress' and 'told'"):
        search(1, on_progress=max, told=len)
