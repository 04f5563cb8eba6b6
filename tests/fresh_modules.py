"""Modules that tests write and import."""

import importlib.util


def fresh_module(folder, name, text):
    """Write a module to a folder, and return it imported anew."""
    folder.mkdir(exist_ok=True)
    (folder / f"{name}.py").write_text(text)
    spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
