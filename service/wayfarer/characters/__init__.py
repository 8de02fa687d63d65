"""Characters of users: bones, retargeting, GLB. The files are the Python client's, linked here."""
