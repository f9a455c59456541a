"""The schema of calibration.json and the table of its keys in docs/, from the types in mpucal/result/keys.py."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Required, Union, get_args, get_origin, get_type_hints, is_typeddict

from mpucal.result.keys import FORMAT, Document, unwrap

NAMES = {str: "string", bool: "boolean", int: "integer", float: "number"}
Schema = dict[str, Any]


def text() -> str:
    """Return calibration.schema.json."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": FORMAT}
    return json.dumps({**head, **schema_of(Document)}, indent=1) + "\n"


def schema_of(hint: Any) -> Schema:
    """Return the JSON Schema of a type: of a mapping with known keys, a sequence, a literal, a number and the like."""
    kind, args = get_origin(hint), get_args(hint)
    if kind is Annotated:
        return _annotated(schema_of(args[0]), hint.__metadata__)
    if kind is Literal:
        return {"type": "string", "enum": list(args)}
    if kind in (Union, UnionType):
        known = schema_of(next(arg for arg in args if arg is not NoneType))
        enum = {"enum": [*known["enum"], None]} if "enum" in known else {}
        return {**known, "type": [known["type"], "null"], **enum}
    if kind is tuple:
        return {"type": "array", "items": schema_of(args[0]), "minItems": len(args), "maxItems": len(args)}
    if kind is Sequence:
        return {"type": "array", "items": schema_of(args[0])}
    if kind is Mapping:
        return {"type": "object", **({} if args[1] is Any else {"additionalProperties": schema_of(args[1])})}
    if is_typeddict(hint) or is_dataclass(hint):
        hints = get_type_hints(hint, include_extras=True)
        required = [key for key, of in hints.items() if get_origin(of) is Required]
        properties = {key: schema_of(unwrap(of)) for key, of in hints.items()}
        return {"type": "object", **({"required": required} if required else {}), "properties": properties}
    return {"type": NAMES[hint]} if hint in NAMES else {}


def _annotated(schema: Schema, metadata: Sequence[Any]) -> Schema:
    """Return a schema with the metadata of `Annotated`: a shape, keywords, and the meaning."""
    for data in metadata:
        if isinstance(data, tuple):
            schema = _of_shape(schema, data)
        else:
            schema = {**schema, **(data if isinstance(data, dict) else {"description": data})}
    return schema


def _of_shape(schema: Schema, shape: tuple[int, ...]) -> Schema:
    items = _of_shape(schema["items"], shape[1:]) if shape[1:] else schema["items"]
    return {**schema, "items": items, "minItems": shape[0], "maxItems": shape[0]}


def table() -> str:
    """Return the table of the keys in Markdown."""
    rows = (f"| {' | '.join(row)} |" for row in _rows(schema_of(Document), ""))
    return "\n".join(["| key | type | meaning |", "|---|---|---|", *rows])


def _rows(schema: Schema, path: str) -> Iterator[tuple[str, str, str]]:
    """Yield key, type and meaning of each key of an object, the inner ones after the outer one."""
    for key, of in schema.get("properties", {}).items():
        inner = of["items"] if of.get("type") == "array" and "properties" in of["items"] else of
        name = f"{path}{key}{'[]' if inner is not of else ''}"
        meaning = of.get("description", "")
        if "const" in of:
            meaning = f"`{of['const']}`"
        elif "enum" in of:
            choices = ", ".join(f"`{choice}`" for choice in of["enum"] if choice is not None)
            meaning = f"{meaning}: {choices}" if meaning else choices
        yield f"`{name}`", _type(of), meaning.replace("|", "\\|")
        yield from _rows(inner, f"{name}.")


def _type(schema: Schema) -> str:
    """Return the type in words, such as `3 x 3 numbers`; null, for what is not known, is left out."""
    kind = schema.get("type", "any")
    kind = kind if isinstance(kind, str) else kind[0]
    if kind != "array" or "minItems" not in schema:
        return kind
    inner = _type(schema["items"])
    return f"{schema['minItems']} {'x ' + inner if inner[0].isdigit() else inner + 's'}"
