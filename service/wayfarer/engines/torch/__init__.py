"""The step in torch on a GPU: an optional extra (`pip install '.[gpu]'`)."""
