"""Functions that make environments, as Python files: worker processes of the program make the environments.

A function of a module is taken from its file. A function of a notebook, of a script or of another function, and a lambda,
is pickled by value with `cloudpickle`, on which Gymnasium depends anyway, into a file that the program treats like any
other: it is copied to the folder of the run, so that the run can be resumed, evaluated and filmed by the program alone,
and several processes step the environments at the same time. If the calling process served them, a run would end with it,
and one Python would step all of them.
"""

from __future__ import annotations

import base64
import functools
import inspect
import pickle
import sys
import textwrap
import types
import warnings
from collections.abc import Callable, Iterator
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

SOURCE_MARK = "# Source, to read and to compare:"

PICKLED = """# The environment `{name}`, a Python function that was pickled by value, and what it uses of the same notebook or script.
#
{source}
import base64
import pickle
import sys

if sys.version_info[:2] != {version}:
    raise ImportError("this environment is a function that was pickled by Python {dotted}, and only this version can read it")

{name} = pickle.loads(base64.b64decode("".join(\"\"\"
{content}
\"\"\".split())))
"""


def name_of(function: Callable[..., Any]) -> str:
    """Name of the environment that a function makes."""
    inner = function.func if isinstance(function, functools.partial) else function
    name = getattr(inner, "__name__", type(inner).__name__)
    return name if name.isidentifier() else "environment"


def environment_id(function: Callable[..., Any], folder: Path, stored: Path | None = None) -> str:
    """The id `FILE.py:NAME` of the environment that a function makes.

    Args:
        function: A function, or another callable, that returns an environment.
        folder: Folder to which a file is written, unless the function has one of its own.
        stored: The file of the same function in the folder of the run that is resumed, which is used instead.

    Raises:
        TypeError: The function cannot be pickled.
    """
    name = name_of(function)
    module = _module_with(function)
    if module is not None and _is_one_file(module):
        return f"{Path(str(module.__file__)).resolve()}:{name}"
    path = folder / f"{name}.py"
    if module is not None:
        text = f"from {module.__name__} import {name} as {name}\n"
    elif stored is not None and stored.is_file():
        text = _stored_text(function, stored)
    else:
        text = _pickled_text(function, name)
    path.write_text(text, encoding="utf-8")
    return f"{path}:{name}"


def _module_with(function: Callable[..., Any]) -> types.ModuleType | None:
    """The module that has the function under its name, if other processes can import it."""
    module = sys.modules.get(getattr(function, "__module__", None) or "")
    if module is None or not getattr(module, "__file__", None) or not _is_importable(module):
        return None
    return module if getattr(module, name_of(function), None) is function else None


def _is_one_file(module: types.ModuleType) -> bool:
    """Whether a module is neither a package nor in one."""
    return "." not in module.__name__ and not hasattr(module, "__path__")


def _is_importable(module: types.ModuleType) -> bool:
    """Whether other processes find a module: not `__main__`, nor one that was loaded in another way."""
    package = module.__name__.partition(".")[0]
    return package != "__main__" and PathFinder.find_spec(package, sys.path) is not None


def _pickled_text(function: Callable[..., Any], name: str) -> str:
    try:
        content = _pickled(function)
    except Exception as error:
        message = f"the function `{name}` that makes the environment cannot be sent to another process: {error}"
        raise TypeError(message) from error
    return PICKLED.format(
        name=name,
        source=_commented(_source_of(function)),
        version=repr(tuple(sys.version_info[:2])),
        dotted=".".join(map(str, sys.version_info[:2])),
        content=textwrap.fill(base64.b64encode(content).decode(), 100),
    )


def _pickled(function: Callable[..., Any]) -> bytes:
    import cloudpickle

    inner = function.func if isinstance(function, functools.partial) else function
    module = sys.modules.get(getattr(inner, "__module__", None) or "")
    is_hidden = module is not None and module.__name__ != "__main__" and not _is_importable(module)
    if is_hidden:
        cloudpickle.register_pickle_by_value(module)
    try:
        return bytes(cloudpickle.dumps(function, protocol=pickle.DEFAULT_PROTOCOL))
    finally:
        if is_hidden:
            cloudpickle.unregister_pickle_by_value(module)


def _stored_text(function: Callable[..., Any], stored: Path) -> str:
    """The file with which a run began; a warning if the function has changed."""
    text = stored.read_text(encoding="utf-8")
    source = _source_of(function)
    if source and _commented(source) not in text:
        warnings.warn(
            f"the function `{name_of(function)}` has changed since the run began: the run continues with the function that "
            f"{stored} has",
            RuntimeWarning,
            stacklevel=2,
        )
    return text


def _commented(source: str) -> str:
    lines = [f"#     {line}".rstrip() for line in source.splitlines()]
    return "\n".join([SOURCE_MARK, "#", *lines, "#"]) if source else "# Its source is not known.\n#"


def _source_of(function: Callable[..., Any]) -> str:
    """Source of a function, and of the functions and classes of the same notebook or script that it names; empty if it is
    not known."""
    sources: dict[str, str] = {}
    waiting: list[Any] = [function]
    while waiting:
        one = waiting.pop()
        if isinstance(one, functools.partial):
            one = one.func
        name = getattr(one, "__qualname__", "")
        if not name or name in sources:
            continue
        try:
            sources[name] = textwrap.dedent(inspect.getsource(one)).strip()
        except (OSError, TypeError):
            continue
        waiting += _named_by(one)
    return "\n\n".join(sources[name] for name in sorted(sources))


def _named_by(one: Any) -> Iterator[Any]:
    """Functions and classes of the same module that a function or a class names."""
    module = getattr(one, "__module__", None)
    names = vars(sys.modules[module]) if module in sys.modules else {}
    functions = [each for each in vars(one).values() if inspect.isfunction(each)] if inspect.isclass(one) else [one]
    if inspect.isclass(one):
        yield from (base for base in one.__mro__[1:] if base.__module__ == module)
    codes = [each.__code__ for each in functions if hasattr(each, "__code__")]
    while codes:
        code = codes.pop()
        codes += [each for each in code.co_consts if isinstance(each, types.CodeType)]
        for name in code.co_names:
            found = names.get(name)
            if (inspect.isfunction(found) or inspect.isclass(found)) and found.__module__ == module:
                yield found
