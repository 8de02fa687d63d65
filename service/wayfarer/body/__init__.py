"""Body models as numpy arrays: skeleton, shape, skinning, phenotype, export."""
