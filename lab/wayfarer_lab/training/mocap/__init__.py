"""Motion capture → prepared data: read, repair, resample, floor, retarget, select."""
