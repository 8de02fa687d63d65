"""Pictures of motion, drawn without GPU or display: stills, sheets, films."""
