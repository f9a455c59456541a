"""Generated files: documentation, drawings, fixtures, vectors and stubs, made from the code."""
