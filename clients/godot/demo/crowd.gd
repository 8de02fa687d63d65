extends Node3D
## Stick figures that walk about. Start the server, then this scene.

@export var people := 12
@export var radius := 8.0

var figures: Array[WayfarerCharacter] = []


func _ready() -> void:
	for k in people:
		var figure := WayfarerStickFigure.make(Color.from_hsv(k / float(people), 0.6, 0.9))
		figure.name = "person %d" % k
		add_child(figure)
		# on a sunflower's spiral: evenly, and no two at one place
		var away := radius * sqrt((k + 0.5) / people)
		figure.position = Vector3(away * sin(2.4 * k), 0.0, away * cos(2.4 * k))
		figure.rotation.y = 2.4 * k
		var walker := WayfarerCharacter.attach(figure)
		walker.wander_radius = radius
		figures.append(walker)
