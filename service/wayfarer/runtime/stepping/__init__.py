"""Who is stepped when, in which batch, and whether there is time."""
