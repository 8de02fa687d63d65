import pytest

from wayfarer.ids import NO_ID, agent_id, agent_ids, group_of, new_group, scene_id, session_id


def test_ids_say_in_which_group_they_are():
    group = new_group()
    session = session_id(group)
    assert group_of(session) == group_of(agent_id(session)) == group_of(scene_id(group)) == group
    assert len({session_id(group) for _ in range(2000)} | {agent_id(session)}) == 2001


def test_ids_of_before_groups_share_one_by_their_first_four_digits():
    """As in snapshots, journals and recordings."""
    session = "session-abcd0123456789ef"
    assert group_of(session) == group_of(agent_id(session)) == "abcd"
    assert group_of("scene-abcdffffffffffff") == group_of("agent-abcd" + 12 * "0") == "abcd"
    assert len(agent_id(session)) == len("agent-") + 16


@pytest.mark.parametrize("name", ["", "session-", "agent-xyz", "session-1", "é" * 90, "agent-ABCD"])
def test_what_is_no_id_has_a_group_too(name):
    assert group_of(name) == NO_ID


def test_agents_of_a_session_with_another_name_are_found_with_it():
    assert group_of(agent_id("mine")) == group_of("mine") == NO_ID


def test_a_request_has_the_same_agents_wherever_it_comes():
    session = session_id(new_group())
    ids = agent_ids(session, "a", 3)
    assert agent_ids(session, "a", 3) == ids and len({*ids, *agent_ids(session, "b", 3)}) == 6
    assert agent_ids(session, "a", 2) == ids[:2] != agent_ids(session_id(new_group()), "a", 2)
    assert {group_of(one) for one in ids} == {group_of(session)}
    assert {len(one) for one in ids} == {len(agent_id(session))}
