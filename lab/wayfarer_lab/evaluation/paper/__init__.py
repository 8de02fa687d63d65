"""The page paper.md: the paper's tables and figures beside ours, from JSON results alone."""
