@tool
extends EditorPlugin
## Nothing to set up: WayfarerSession and WayfarerCharacter are in the list of nodes as soon as the
## folder is in the project.
