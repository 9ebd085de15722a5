"""The live page: a running scene in a browser, by `asperity view SCENE`."""
