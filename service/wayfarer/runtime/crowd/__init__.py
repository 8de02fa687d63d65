"""People among people: whom to give way to, and behaviours that depend on others. Pure numpy."""
