"""The process: log lines, cores, compiled rules."""
