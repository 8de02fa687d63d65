"""Nothing lost: snapshots, the journal, command logs and their replay."""
