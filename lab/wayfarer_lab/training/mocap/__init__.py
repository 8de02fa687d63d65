"""Motion capture → prepared data: read, repair, resample, floor, retarget, augment, select."""
