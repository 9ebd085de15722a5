from asperity.engine.engine import Engine  # noqa: F401
