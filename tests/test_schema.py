"""The JSON Schemas explain every field."""

import json

import pytest

from netsp.command.main import main
from netsp.command.schema import FORMATS


def fields(schema):
    """(model, field, what is said of it) of a schema."""
    for name, model in {schema["title"]: schema, **schema.get("$defs", {})}.items():
        for field, said in model.get("properties", {}).items():
            yield name, field, said


@pytest.mark.parametrize("name", FORMATS)
def test_every_field_is_described(name, capsys):
    assert main(["schema", name]) == 0
    schema = json.loads(capsys.readouterr().out)
    found = list(fields(schema))
    assert found
    assert [f"{m}.{f}" for m, f, said in found if not said.get("description")] == []


@pytest.mark.parametrize("name", FORMATS)
def test_every_length_time_and_angle_has_its_unit(name, capsys):
    main(["schema", name])
    schema = json.loads(capsys.readouterr().out)
    numbers = {"tether_length", "clearance", "radius", "range", "speed", "delta", "cell", "time"}
    numbers |= {"patch", "reach", "gusts", "field_of_view", "tilt", "angle", "rotation", "length"}
    units = ("units", " m", "m/s", "seconds", "degrees", "m")
    for model, field, said in fields(schema):
        if field in numbers:
            assert said["description"].endswith(units) or any(
                u in said["description"] for u in units[:-1]
            ), f"{model}.{field}"
