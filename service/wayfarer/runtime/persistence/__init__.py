"""Journal, snapshots, recordings and their replay."""
