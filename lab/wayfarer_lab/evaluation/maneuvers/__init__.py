"""Every manoeuvre as people would do it: what is asked, how it is judged, what is good enough."""
