"""Model folders: files with their contracts, opened together with the bodies."""
