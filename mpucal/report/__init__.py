"""The page a person looks at. Knows no estimate and no file."""

from .html import render

__all__ = ["render"]
