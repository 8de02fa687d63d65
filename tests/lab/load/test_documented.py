"""docs/measuring.md explains all figures, and its calls exist."""

import json
import re
from pathlib import Path

from google.protobuf import json_format
from google.protobuf.descriptor_pool import Default
from google.protobuf.message_factory import GetMessageClass

from wayfarer.v1 import goal_pb2  # noqa: F401  its descriptors
from wayfarer_lab.load.tally import Tally

PAGE = (Path(__file__).parents[3] / "docs" / "measuring.md").read_text()


def test_every_key_of_the_json_file_is_told():
    told = set(re.findall(r"`(\w+)`", PAGE))
    assert set(Tally().summary(1.0)) <= told


def test_the_calls_of_the_ghz_recipe_exist_and_take_its_data():
    recipe = PAGE.replace("\\\n", " ")
    calls = re.findall(r"--call wayfarer\.v1\.(\w+)\.(\w+)\s+--data '(.*?)'\s", recipe)
    assert [method for _, method, _ in calls] == ["SetGoal"]
    for service, method, data in calls:
        found = Default().FindServiceByName(f"wayfarer.v1.{service}").FindMethodByName(method)
        request = json.loads(data.replace("'$A'", "a-1"))
        message = GetMessageClass(found.input_type)()
        json_format.ParseDict(request, message)
        assert message.agent_id == "a-1"
