extends RefCounted
## Messages of the stream (tests/golden/messages.py says what is in them), and the player.

const Checks := preload("res://tests/checks.gd")


func test_a_header_gives_rate_basis_skeleton_and_encoding(check: Checks) -> void:
	var decoder := WayfarerStreamDecoder.new()
	check.equal(decoder.decode(check.message("header")), "header")
	check.equal(decoder.sent_at, 1_780_000_000.2)
	var header := decoder.header
	check.equal([header.server_version, header.session_id], ["1.2.3", "s-1"])
	check.equal([header.fps, header.sent_fps, header.frame_bytes], [40, 40, 44])
	check.equal([header.basis, header.metres_per_unit, header.encoding], ["gltf", 1.0, 1])
	check.equal(
		header.skeleton, [{"name": "pelvis", "parent": -1}, {"name": "left_hip", "parent": 0}]
	)
	check.equal([Array(header.bones), header.resumed], [[0, 1], false])
	decoder.decode(check.message("header_small"))
	header = decoder.header
	check.equal([header.encoding, header.sent_fps, header.frame_bytes], [3, 10, 18])
	check.equal([Array(header.bones), header.resumed], [[1], true])


func test_a_batch_gives_new_agents_chunks_and_removals(check: Checks) -> void:
	var decoder := WayfarerStreamDecoder.new()
	decoder.decode(check.message("batch"))
	var agent := decoder.added[0]
	check.equal(
		[agent.id, agent.alias, agent.name, agent.body, agent.gender, agent.seed_number],
		["a-7", 300, "Zoë", "anny52", "male", 4294967295]
	)
	check.equal([Array(agent.betas), Array(agent.rest_offsets)], [[0.5, -1.25, 3.0], [0.0, 1.0, 2.0]])
	check.equal([Array(decoder.removed), decoder.resume_token], [[1, 300], "r.1.41"])
	var chunk := decoder.chunk(0)
	check.equal(
		[chunk.alias, chunk.seq, chunk.first_frame, chunk.goal_revision, chunk.frames, chunk.state],
		[300, 12, 96, 3, 3, "walking"]
	)
	check.equal([chunk.flags, chunk.waypoint, chunk.candidates], [5, 2, 8])
	check.equal(chunk.scheduled_at, 1_780_000_000.123456)
	check.equal(Array(decoder.bytes().slice(chunk.contacts, chunk.contacts + 3)), [1, 3, 2])
	var poses := WayfarerPoses.unpack(decoder.bytes(), chunk.poses, 3, 1, 2)
	check.equal(poses[2].hips, Vector3(2.0, 2.5, 2.25))
	check.equal(poses[2].turns[1], Quaternion(0.5, -0.5, 0.5, -0.5))
	var second := decoder.chunk(1)
	check.equal([second.alias, second.state], [7, "standing"])
	check.equal(WayfarerPoses.unpack(decoder.bytes(), second.poses, 3, 1, 2)[0].hips.x, 3.0)


func test_all_tiers_are_shown_alike_and_who_is_hidden_is_taken_away(check: Checks) -> void:
	var heard: Array[String] = []
	var player := WayfarerMotionPlayer.new()
	player.agent_added.connect(func(p: Variant) -> void: heard.append("added %d" % p.agent.alias))
	player.agent_removed.connect(func(p: Variant) -> void: heard.append("hidden %s" % p.hidden))
	player.receive(check.message("header_tiers"), 0.0)
	var middle := player.header.tiers[1]
	check.equal(
		[middle.radius, middle.encoding, middle.sent_fps, Array(middle.bones), middle.frame_bytes],
		[30.5, 3, 20, [1], 18]
	)
	player.receive(check.message("batch_root"), 0.0)
	player.advance(0.1)
	var played := player.agents[300]
	check.equal([played.shown, played.tier, played.pose.turns.size()], [true, 2, 2])
	check.equal(played.pose.hips, Vector3(0.0, 0.5, 0.25))
	# batch { hidden: [300] }
	check.equal(player.receive(PackedByteArray([0x1a, 4, 0x32, 2, 0xac, 2]), 1.0), "batch")
	player.receive(check.message("batch_root"), 1.0)
	check.equal(heard, ["added 300", "hidden true", "added 300"])
	player.receive(check.message("header"), 1.0)
	check.equal(player.receive(check.message("batch_root"), 1.0), "error")
	check.holds("1 tiers, not of 2" in player.error, player.error)


func test_who_comes_nearer_goes_on_and_who_was_not_introduced_is_not_shown(check: Checks) -> void:
	var heard: Array[String] = []
	var player := WayfarerMotionPlayer.new()
	player.agent_added.connect(func(p: Variant) -> void: heard.append("added %d" % p.agent.alias))
	player.agent_removed.connect(func(p: Variant) -> void: heard.append("hidden %s" % p.hidden))
	player.receive(check.message("header_tiers"), 0.0)
	player.receive(check.message("batch_closer"), 0.0)
	check.equal(player.agents.size(), 0)
	player.receive(check.message("batch_root"), 0.0)
	var played := player.agents[300]
	check.equal(played.tier, 2)
	player.receive(check.message("batch_closer"), 0.2)
	player.advance(0.3)
	check.equal([played.shown, played.tier, player.agents[300] == played], [true, 1, true])
	# batch { hidden: [300] }
	player.receive(PackedByteArray([0x1a, 4, 0x32, 2, 0xac, 2]), 0.4)
	player.receive(check.message("batch_closer"), 0.4)
	check.equal(player.agents.size(), 0)
	check.equal(heard, ["added 300", "hidden true"])


func test_tiers_with_less_than_all_bones_become_whole_poses(check: Checks) -> void:
	for own: Dictionary in check.document("tiers.json").cases:
		var header := WayfarerStreamDecoder.Header.new()
		header.basis = own.basis
		header.bones = PackedInt64Array(own.bones)
		var first := WayfarerStreamDecoder.Tier.new()
		first.encoding = WayfarerPoses.Encoding.F32_LE
		first.bones = header.bones
		header.tiers.append(first)
		for tier: Dictionary in own.tiers:
			var next := WayfarerStreamDecoder.Tier.new()
			next.encoding = int(tier.encoding)
			next.bones = PackedInt64Array(tier.bones)
			header.tiers.append(next)
		var unpacker := WayfarerTierUnpacker.new(header)
		check.equal(unpacker.error, "")
		for k in own.tiers.size():
			var tier: Dictionary = own.tiers[k]
			var bytes := String(tier.poses).hex_decode()
			@warning_ignore("integer_division")
			var count := bytes.size() / int(tier.frame_bytes)
			var poses := unpacker.unpack(bytes, 0, count, k + 1)
			for frame in count:
				var what := "%s, tier %d, frame %d" % [own.basis, k + 1, frame]
				var hips: Array = tier.hips.slice(3 * frame, 3 * frame + 3)
				check.near_place(poses[frame].hips, hips, 1e-3, what)
				for bone in 22:
					var at := 88 * frame + 4 * bone
					var wanted: Array = tier.rotations.slice(at, at + 4)
					check.near_turn(poses[frame].turns[bone], wanted, 1e-3, what)


func test_an_event_says_what_happened_to_whom(check: Checks) -> void:
	var decoder := WayfarerStreamDecoder.new()
	check.equal(decoder.decode(check.message("event")), "event")
	var event := decoder.event
	check.equal(
		[event.kind, event.agent_id, event.alias, event.goal_revision, event.waypoint, event.detail],
		["goal_reached", "a-7", 300, 3, 2, "goal 3 of 4 reached"]
	)


func test_a_decoder_keeps_nothing_but_the_token_to_resume(check: Checks) -> void:
	var decoder := WayfarerStreamDecoder.new()
	decoder.decode(check.message("batch"))
	check.equal(decoder.decode(check.message("heartbeat")), "heartbeat")
	check.equal([decoder.chunks, decoder.added.size(), decoder.removed.size()], [0, 0, 0])
	check.equal(decoder.resume_token, "r.1.41")


func test_what_is_malformed_is_refused_in_words(check: Checks) -> void:
	var refused := {
		"columns": [0x1a, 6, 0x12, 4, 0x0a, 2, 1, 2],
		"wire type 3 in place of 0": [0x0b],
		"field number 0": [0x00, 1],
		"10 bytes": [0x08, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255],
		"passes its end": [0x1a, 0xff, 0xff, 0xff, 0xff, 0x0f],
		"above 2^31": [0x1a, 10, 0x12, 8, 0x10, 0xff, 0xff, 0xff, 0xff, 0x0f, 8, 1],
		"broken packed field": [0x1a, 5, 0x0a, 3, 0x3a, 1, 7],
	}
	for said: String in refused:
		var decoder := WayfarerStreamDecoder.new()
		check.equal(decoder.decode(PackedByteArray(refused[said])), "error", said)
		check.holds(said in decoder.error, "%s: %s" % [said, decoder.error])


func test_every_cut_of_a_message_is_an_error_or_a_shorter_message(check: Checks) -> void:
	var whole := check.message("batch")
	var decoder := WayfarerStreamDecoder.new()
	for length in whole.size():
		if decoder.decode(whole.slice(0, length)) == "error":
			check.holds("malformed message" in decoder.error, decoder.error)
	check.equal(decoder.decode(whole.slice(0, -1)), "error")


func test_a_player_shows_agents_tells_of_them_and_counts(check: Checks) -> void:
	var heard: Array[String] = []
	var player := WayfarerMotionPlayer.new()
	player.header_received.connect(
		func(_header: Variant, again: bool) -> void: heard.append("header %s" % again)
	)
	player.agent_added.connect(func(p: Variant) -> void: heard.append("added " + p.agent.id))
	player.agent_removed.connect(func(p: Variant) -> void: heard.append("removed " + p.agent.id))
	player.chunk_received.connect(
		func(_p: Variant, chunk: Variant) -> void: heard.append("chunk %d" % chunk.seq)
	)
	player.event_received.connect(func(told: Variant) -> void: heard.append(told.kind))
	check.equal(player.receive(check.message("batch"), 0.0), "error")
	check.equal(player.error, "motion came before the header")
	player.receive(check.message("header"), 0.0)
	check.equal(player.receive(check.message("batch"), 0.0), "batch")
	check.equal(heard, ["header false", "added a-7", "chunk 12", "removed a-7"])
	check.equal([player.stats.chunks, player.stats.frames, player.stats.gaps], [2, 6, 0])
	check.equal(player.receive(check.message("batch_small"), 0.0), "error")
	check.equal(player.error, "36 bytes of poses are not 2 frames of 44 bytes")
	player.begin()
	check.equal(player.receive(check.message("batch"), 0.0), "error")
	player.receive(check.message("header_small"), 0.1)
	player.receive(check.message("batch_small"), 0.1)
	player.advance(0.2)
	var zoe: WayfarerMotionPlayer.PlayedAgent = player.agents[300]
	check.equal([zoe.shown, zoe.state, zoe.pose.turns.size()], [true, "standing", 1])
	player.receive(check.message("event"), 0.2)
	check.equal(heard[-1], "goal_reached")
	check.equal([player.stats.gaps, player.stats.held], [1, 1])
	player.clear()
	check.equal([heard[-1], player.agents.size()], ["removed a-7", 0])
