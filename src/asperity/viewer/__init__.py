"""The live page: a scene that is being felt, seen in a browser. `asperity view SCENE`."""
