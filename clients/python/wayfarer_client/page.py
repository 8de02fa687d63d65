"""A session in the server's viewer: in a browser, or in the frame of a notebook."""

import sys
import webbrowser
from typing import Any, Final

from wayfarer_client.homes import Homes

HTTP_PORT: Final = 8080
HEIGHT_PX: Final = 480


def page_of(homes: Homes, session_id: str, url: str, secure: bool) -> str:
    """The address of a session in the viewer at `url`; "": port 8080 of the host that is called."""
    viewer = url or f"http{'s' * secure}://{homes.node('', HTTP_PORT)}"
    return f"{viewer.rstrip('/')}/?session={session_id}"


def show(address: str) -> None:
    """Frame it in a notebook; otherwise open it in a browser, or print it where there is none."""
    if in_notebook():
        from IPython.display import IFrame, display

        frame: Any = IFrame(address, "100%", HEIGHT_PX)
        display(frame)
    elif not webbrowser.open(address):
        sys.stdout.write(f"the session is shown at {address}\n")


def in_notebook() -> bool:
    """Whether this program is the kernel of a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None
