extends RefCounted
## Where a call goes next: the cases of every client.

const Checks := preload("res://tests/checks.gd")


func test_a_call_goes_where_the_rule_says(check: Checks) -> void:
	for each: Dictionary in check.document("homes.json").cases:
		var homes := WayfarerHomes.new(each.entry)
		for call: Dictionary in each.calls:
			var route := WayfarerHomes.Route.new(homes, call.about)
			for k in call.called.size():
				check.equal(route.address, call.called[k], each.name)
				var answer: Dictionary = call.answers[k]
				var last: bool = k == call.called.size() - 1
				if "answered" in answer:
					check.holds(last and not call.fails, each.name)
					route.answered(answer.answered)
				elif "unavailable" in answer:
					check.equal(route.unavailable(), not last, each.name)
				else:
					var place: Array = answer.misdirected
					check.equal(route.misdirected(place[0], int(place[1])), not last, each.name)
		check.equal(homes.home(each.about), each.home, each.name)


func test_a_streams_close_reason_names_the_node(check: Checks) -> void:
	for each: Array in check.document("homes.json").reasons:
		check.equal(WayfarerHomes.place_of(each[0]), [each[1], int(each[2])], each[0])
