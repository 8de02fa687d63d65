"""A session in the viewer, from Python."""

import sys
import types
import webbrowser

import pytest

from wayfarer_client.homes import Homes
from wayfarer_client.page import page_of


@pytest.mark.parametrize(
    ("called", "url", "secure", "page"),
    [
        ("localhost:50051", "", False, "http://localhost:8080/?session=s"),
        ("[::1]:50051", "", True, "https://[::1]:8080/?session=s"),
        ("a.b:1", "https://c.d/wf/", False, "https://c.d/wf/?session=s"),
    ],
)
def test_the_page_of_a_session(called: str, url: str, secure: bool, page: str):
    assert page_of(Homes(called), "s", url, secure) == page


async def test_it_opens_in_a_browser_or_is_printed_or_framed(client, monkeypatch, capsys):
    session = await client.create_session()
    opened = []
    for works in (True, False):
        monkeypatch.setattr(webbrowser, "open", lambda at, works=works: opened.append(at) or works)
        address = await session.show()
        assert opened.pop() == address and address.endswith(f":8080/?session={session.session_id}")
        assert (address in capsys.readouterr().out) is not works
    framed = types.ModuleType("IPython.display")
    framed.IFrame = lambda *how: how
    framed.display = opened.append
    notebook = types.ModuleType("IPython")
    notebook.get_ipython = lambda: types.SimpleNamespace(kernel=object())
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    monkeypatch.setitem(sys.modules, "IPython.display", framed)
    assert opened == [] and await session.show("http://x") == opened[0][0]
    assert capsys.readouterr().out == ""
