"""The page of the compiled half: signatures of python/clothsim/_core.pyi, texts of the module itself."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

ROOT = Path(__file__).parents[2]
STUB = ROOT / "python" / "clothsim" / "_core.pyi"

HEAD = """# The extension

`clothsim._core` is what the package calls in Rust. It is private: names and arguments follow the package's needs and
change without notice. It takes and gives NumPy arrays of the shapes that the package's pages state, and raises the
package's [errors](errors.md).
"""


def page() -> str:
    """Return the page as Markdown."""
    import clothsim._core as core

    lines = [HEAD]
    for node in ast.parse(STUB.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef):
            lines += [f"## `{node.name}`", "", _signature(node), _text(getattr(core, node.name)), ""]
        elif isinstance(node, ast.ClassDef):
            value = getattr(core, node.name)
            lines += [f"## `{node.name}`", "", _text(value), ""]
            methods = [item for item in node.body if isinstance(item, ast.FunctionDef)]
            for method in methods:
                if not method.name.startswith("_"):
                    text = _text(getattr(value, method.name))
                    lines += [f"### `{node.name}.{method.name}`", "", _signature(method), text, ""]
    return "\n".join(lines)


def _signature(node: ast.FunctionDef) -> str:
    returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    text = f"{node.name}({ast.unparse(node.args)}){returns}".replace("_Floats", "Floats").replace("_Ints", "Ints")
    if len(text) > 96:
        arguments = [*node.args.args, *node.args.kwonlyargs]
        inner = ",\n".join(f"    {ast.unparse(argument)}" for argument in arguments)
        text = f"{node.name}(\n{inner},\n){returns}".replace("_Floats", "Floats").replace("_Ints", "Ints")
    return f"```text\n{text}\n```"


def _text(value: object) -> str:
    return (inspect.getdoc(value) or "").replace("|", "\\|").replace("<", "&lt;")
