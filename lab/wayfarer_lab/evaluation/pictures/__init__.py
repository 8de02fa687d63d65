"""Pictures of motion for people to judge, drawn without GPU or display: stills, sheets, films."""
