"""What is computed while a session goes on: asked for and brought at fixed numbers of samples, whoever is faster."""
